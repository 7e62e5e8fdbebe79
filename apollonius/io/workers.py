"""Workers for independent jobs: processes on this machine, a Slurm array, or a Ray cluster.

All machines must see the same folders: a job whose worker is lost is resumed on another one from its files.
"""

import os
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from apollonius.io.errors import InvalidInput, require, require_extra
from apollonius.io.interrupts import asked_to_stop
from apollonius.io.jobs import DONE, POLL_SECONDS, STOPPED, Job, available_cores, in_processes

Workers = Callable[[Sequence[Job], Callable[[], bool], Path], Iterator[tuple[Job, str]]]
"""Runs jobs and yields each with its ending, as `in_processes` does; logs go to the folder."""
LOST_WORKERS = 10
"""Most restarts of a job whose worker was lost."""
_QUEUE_SECONDS = 3.0
"""Time between two looks at Slurm's queue."""
_SLURM_MINUTES = 24 * 60
"""Time limit of a Slurm job, unless SBATCH_TIMELIMIT says another; a job that reaches it is requeued."""


def run_jobs(jobs: Sequence[Job], report: Callable[[str], None], on: str = "processes", logs: Path = Path()) -> bool:
    """Run all jobs; one that fails does not end the others.

    Args:
        report: called with a line whenever a job ends.
        on: one of `WORKERS`.
        logs: folder of what jobs print on Slurm.

    Returns:
        Whether all came to their ends; False after Ctrl-C, when every job that was running has stopped by itself.

    Raises:
        InvalidInput: when jobs failed, after all others; when a library or Slurm is missing.
    """
    require(on in WORKERS, "on", on, f"one of {', '.join(WORKERS)}")
    endings: dict[str, str] = {}
    with asked_to_stop(again=False) as asked:
        for job, ending in WORKERS[on](jobs, asked, logs) if jobs else ():
            endings[job.name] = ending
            report(f"{ending}: {job.name}" if ending in (DONE, STOPPED) else f"failed: {job.name} ({ending})")
    failed = [name for name, ending in endings.items() if ending not in (DONE, STOPPED)]
    if failed:
        raise InvalidInput(f"{len(failed)} of {len(jobs)} failed ({', '.join(failed)}): mend the cause and go on.")
    return len(endings) == len(jobs) and STOPPED not in endings.values()


class _SlurmCall:
    """Runs a job on Slurm, and is what a requeued one begins with."""

    def __call__(self, job: Job) -> str:
        with asked_to_stop(again=False) as asked:  # by scancel, a preemption or a requeue
            return job.run(asked)

    def checkpoint(self, job: Job) -> object:
        """Return the call that resumes the job, which `submitit` asks for before the time limit."""
        from submitit.helpers import DelayedSubmission  # pyright: ignore[reportMissingImports]

        return DelayedSubmission(self, job)


def on_slurm(jobs: Sequence[Job], asked: Callable[[], bool], logs: Path) -> Iterator[tuple[Job, str]]:
    """Run the jobs as an array, one core each; the environment variables of `sbatch` say partition, time and memory.

    A job that left the queue without a result was lost, and is submitted again.
    """
    require_extra("slurm", "slurm")
    import submitit  # pyright: ignore[reportMissingImports]

    executor = submitit.SlurmExecutor(logs.absolute(), max_num_timeout=LOST_WORKERS)
    executor.update_parameters(job_name="apollonius", time=_SLURM_MINUTES, array_parallelism=len(jobs))
    losses, cancelled = Counter[str](), False
    try:
        waiting = dict(zip(executor.map_array(_SlurmCall(), jobs), jobs, strict=True))
        while waiting:
            if asked() and not cancelled:
                cancelled = True
                subprocess.run(["scancel", *(one.job_id for one in waiting)], check=False)
            queued = _queued()
            for one in [one for one in waiting if one.job_id not in queued] if queued is not None else ():
                job = waiting.pop(one)
                if one.paths.result_pickle.exists():
                    yield job, f"see {one.paths.stderr}" if one.exception() else one.result()
                elif cancelled:
                    yield job, STOPPED
                elif losses[job.name] == LOST_WORKERS:
                    yield job, f"it was lost {LOST_WORKERS + 1} times, see {one.paths.stderr}"
                else:
                    losses[job.name] += 1
                    waiting[executor.submit(_SlurmCall(), job)] = job
            _nap(asked)
    except (submitit.core.utils.FailedSubmissionError, submitit.core.utils.FailedJobError) as error:
        raise InvalidInput(f"sbatch refuses the jobs ({error}): correct the variables SBATCH_... and go on.") from error


def _queued() -> set[str] | None:
    """Return the jobs in Slurm's queue, waiting or running; None where it does not answer."""
    ask = ["squeue", "-h", "-r", "-o", "%i", "-u", str(os.getuid())]
    found = subprocess.run(ask, capture_output=True, text=True, check=False)
    return None if found.returncode else set(found.stdout.split())


def _nap(asked: Callable[[], bool]) -> None:
    """Wait until it is time to look at the queue again, or a Ctrl-C is heard."""
    end, before = time.monotonic() + _QUEUE_SECONDS, asked()
    while time.monotonic() < end and asked() == before:
        time.sleep(POLL_SECONDS)


def on_ray(jobs: Sequence[Job], asked: Callable[[], bool], logs: Path) -> Iterator[tuple[Job, str]]:
    """Run as many jobs at a time as the cluster has cores: the one of RAY_ADDRESS, or a new one of this machine."""
    require_extra("ray", "ray")
    import ray  # pyright: ignore[reportMissingImports]
    from ray.exceptions import RayError  # pyright: ignore[reportMissingImports]

    ours = not ray.is_initialized()
    if ours:
        own = {"num_cpus": len(available_cores()), "include_dashboard": False}
        ray.init(**{} if "RAY_ADDRESS" in os.environ else own, log_to_driver=False)
    try:
        remote = ray.remote(num_cpus=1, max_retries=LOST_WORKERS)(lambda job: job.run(lambda: False))
        waiting = {remote.remote(job): job for job in jobs}
        while waiting and not asked():
            for one in ray.wait(list(waiting), timeout=POLL_SECONDS)[0]:
                job = waiting.pop(one)
                try:
                    yield job, ray.get(one)
                except RayError as error:
                    yield job, str(error)
        for one, job in waiting.items():
            ray.cancel(one)
            yield job, STOPPED
    finally:
        if ours:
            ray.shutdown()


WORKERS: dict[str, Workers] = {"processes": in_processes, "slurm": on_slurm, "ray": on_ray}
"""All kinds of workers, by name."""
