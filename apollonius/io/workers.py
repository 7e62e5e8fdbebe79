"""Independent jobs, and workers that do them: processes on this machine, a Slurm array, or a Ray cluster.

A job is a function that can be imported by its name, writes its results to files and resumes where it was stopped: it
may run anywhere that has the same folders, and be started any number of times.
"""

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.io.cache import keep_compilations
from apollonius.io.errors import InvalidInput, require, require_extra
from apollonius.io.interrupts import SIGNALS, asked_to_stop, listen

if TYPE_CHECKING:
    from multiprocessing.context import SpawnProcess

DONE, STOPPED = "done", "stopped"
"""Endings of jobs that did not fail; any other says why one failed."""
_STOPPED_STATUS = 130
"""Exit status of a job that was stopped early."""
_STOPPED_STATUSES = {_STOPPED_STATUS, *(128 + number for number in SIGNALS), *(-number for number in SIGNALS)}
"""Exit statuses of jobs that were stopped; signals may reach them again while they leave."""
POLL_SECONDS = 0.2
"""Time between two looks at whether to stop."""
LOST_WORKERS = 10
"""Most restarts of a job whose worker was lost."""
_QUEUE_SECONDS = 3.0
"""Time between two looks at Slurm's queue."""
_SLURM_MINUTES = 24 * 60
"""Time limit of a Slurm job, unless SBATCH_TIMELIMIT says another; a job that reaches it is requeued."""


@dataclass(frozen=True)
class Job:
    """A call `work(*arguments, should_stop)`, which returns whether it finished."""

    name: str
    work: Callable[..., bool]
    arguments: tuple[Any, ...]

    def run(self, should_stop: Callable[[], bool]) -> str:
        """Run the job here and return its ending: `DONE`, `STOPPED`, or the line of a refusal."""
        keep_compilations()
        try:
            return DONE if self.work(*self.arguments, should_stop) else STOPPED
        except (InvalidInput, OSError) as error:
            return str(error)


def available_cores() -> list[int]:
    """Return the numbers of the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def in_processes(jobs: Sequence[Job], asked: Callable[[], bool], logs: Path) -> Iterator[tuple[Job, str]]:
    """Run as many jobs at a time as there are cores, a process each; yield each with its ending.

    Where one process is killed, a `ProcessPoolExecutor` ends all jobs and names none; one for each job is no shorter.
    `asked` is asked again and again: True stops the jobs that are running, and none begins after that.
    """
    import multiprocessing
    from multiprocessing import connection, resource_tracker

    spawn = multiprocessing.get_context("spawn")  # which inherits no threads of JAX; a forked process may hang
    waiting, free, over = list(jobs), available_cores(), False
    running: dict[int, tuple[Job, SpawnProcess, int]] = {}
    resource_tracker.ensure_running()  # begins with the first process else, and then unblocks Ctrl-C
    while running or (waiting and not over):
        while waiting and free and not over:
            job, core = waiting.pop(0), free.pop()
            process = spawn.Process(target=_work, args=(job, core, os.getpid()))
            signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # the new process inherits this, and hears in `_work`
            process.start()
            signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
            running[process.sentinel] = job, process, core
        for ended in connection.wait(list(running), timeout=POLL_SECONDS):
            assert isinstance(ended, int)
            job, process, core = running.pop(ended)
            process.join()
            free.append(core)
            status = process.exitcode or 0
            over = over or status in _STOPPED_STATUSES
            failed = f"its process ended with exit status {status}"
            yield job, DONE if status == 0 else STOPPED if status in _STOPPED_STATUSES else failed
        if asked() and not over:  # from a terminal the processes have heard of Ctrl-C as well, else only this one
            over = True
            for _, process, _ in running.values():
                process.terminate()


def _work(job: Job, core: int, parent: int) -> None:
    """Run one job on one core as a whole process, which stops early on Ctrl-C or when its parent is gone."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})  # two jobs whose threads share two cores disturb each other
    listen(says=False)
    with asked_to_stop(again=False) as asked:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        ending = job.run(lambda: asked() or os.getppid() != parent)
    if ending not in (DONE, STOPPED):
        print(f"{job.name}: {ending}", file=sys.stderr)
        sys.exit(2)
    sys.exit(_STOPPED_STATUS if ending == STOPPED else 0)


def run_jobs(jobs: Sequence[Job], report: Callable[[str], None], on: str = "processes", logs: Path = Path()) -> None:
    """Run all jobs; one that fails does not end the others.

    Args:
        report: called with a line whenever a job ends.
        on: one of `WORKERS`.
        logs: folder of what jobs print on Slurm.

    Raises:
        KeyboardInterrupt: after Ctrl-C, when every job that was running has stopped by itself.
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
    if len(endings) < len(jobs) or STOPPED in endings.values():
        raise KeyboardInterrupt


def on_slurm(jobs: Sequence[Job], asked: Callable[[], bool], logs: Path) -> Iterator[tuple[Job, str]]:
    """Run the jobs as an array, one core each; the environment variables of `sbatch` say partition, time and memory.

    A job that left the queue without a result was lost, and is submitted again.
    """
    require_extra("slurm", "slurm")
    import submitit  # pyright: ignore[reportMissingImports]

    class Call(submitit.helpers.Checkpointable):  # pyright: ignore[reportUntypedBaseClass]
        """Runs a job, and is what a requeued one begins with."""

        def __call__(self, job: Job) -> str:
            with asked_to_stop(again=False) as asked:  # by scancel, a preemption or a requeue
                return job.run(asked)

    executor = submitit.SlurmExecutor(logs.absolute(), max_num_timeout=LOST_WORKERS)
    executor.update_parameters(job_name="apollonius", time=_SLURM_MINUTES, array_parallelism=len(jobs))
    losses, cancelled = Counter[str](), False
    try:
        waiting = dict(zip(executor.map_array(Call(), jobs), jobs, strict=True))
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
                    waiting[executor.submit(Call(), job)] = job
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


WORKERS = {"processes": in_processes, "slurm": on_slurm, "ray": on_ray}
"""All kinds of workers, by name: each runs jobs and yields them with their endings; logs go to the folder."""
