"""Independent jobs, and workers that do them: processes on this machine, a Slurm array, or a Ray cluster.

A job is a function that can be imported by its name, writes its results to files and resumes where it was stopped: it
may run anywhere that has the same folders, and be started any number of times.
"""

import os
import re
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from apollonius.io.cache import keep_compilations
from apollonius.io.errors import LONGEST_MESSAGE, InvalidInput, require, require_extra, shown
from apollonius.io.interrupts import SIGNALS, asked, asked_to_stop, listen

DONE, STOPPED = "done", "stopped"
"""Endings of jobs that did not fail; any other says why one failed."""
POLL_SECONDS = 0.2
"""Time between two looks at whether to stop."""
_RESTARTS = 10
"""Most restarts of a job that reached its time limit on Slurm, or whose worker was lost."""
_POLLS_PER_LOOK = 15
"""Looks at whether to stop between two at Slurm's queue."""
_LOOKS_WHEN_LOST = 40
"""Looks in a row that find no trace of a lost job: two minutes, of which NFS may hide a new file for one."""
_SLURM_MINUTES = 24 * 60
"""Time limit of a Slurm job, unless SBATCH_TIMELIMIT says another; a job that reaches it is requeued."""
Ending = tuple[str, Any]
"""The ending of a job, and the value that it returned."""


@dataclass(frozen=True)
class Job:
    """A call, which returns its result, or False if it was `asked` to stop."""

    name: str
    work: Callable[..., Any]
    arguments: tuple[Any, ...]

    def run(self) -> Ending:
        """Run the job here; how it ends is `DONE`, `STOPPED`, or the line of a refusal."""
        keep_compilations()
        try:
            made = self.work(*self.arguments)
            return STOPPED if made is False else DONE, made
        except KeyboardInterrupt:
            return STOPPED, None
        except (InvalidInput, OSError) as error:
            return _reason(error), None


def _reason(error: BaseException) -> str:
    """Return why a job failed; some errors, such as a MemoryError, have a name and no words."""
    return shown(str(error) or type(error).__name__, LONGEST_MESSAGE)


Run = Callable[[Sequence[Job]], list[Any]]
"""From jobs to their results, as `run_jobs` with its other arguments."""


def run_jobs(
    jobs: Sequence[Job], report: Callable[[str], None] = print, on: str = "processes", logs: Path | None = None
) -> list[Any]:
    """Run all jobs `on` one of `WORKERS` and return their results; one that fails does not end the others.

    A line is reported whenever a job ends; what jobs print on Slurm is kept in the folder of logs, if there is one.
    Raises KeyboardInterrupt after Ctrl-C, when every job has stopped by itself, and InvalidInput when jobs failed,
    after all others, or a library or Slurm is missing.
    """
    require(on in WORKERS, "on", on, f"one of {', '.join(WORKERS)}")
    results, failed, stopped = dict[str, Any](), list[str](), False
    with asked_to_stop(again=False):
        for job, (ending, made) in WORKERS[on](jobs, logs) if jobs else ():
            results[job.name], stopped = made, stopped or ending == STOPPED
            if ending not in (DONE, STOPPED):
                failed.append(job.name)
            report(f"failed: {job.name} ({ending})" if job.name in failed else f"{ending}: {job.name}")
    if failed:
        raise InvalidInput(f"{len(failed)} of {len(jobs)} failed ({', '.join(failed)}): mend the cause and go on.")
    if stopped or len(results) < len(jobs):
        raise KeyboardInterrupt
    return [results[job.name] for job in jobs]


def available_cores() -> list[int]:
    """Return the numbers of the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def in_processes(jobs: Sequence[Job], logs: Path | None) -> Iterator[tuple[Job, Ending]]:
    """Run as many jobs at a time as there are cores, a process each; yield each with its ending.

    A pool whose process is killed ends all its jobs, so each has its own.
    """
    import multiprocessing
    from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
    from multiprocessing import resource_tracker

    spawn = multiprocessing.get_context("spawn")  # which inherits no threads of JAX; a forked process may hang
    waiting, cores, over = list(jobs), available_cores(), False
    running: dict[Any, tuple[Job, ProcessPoolExecutor, int]] = {}
    resource_tracker.ensure_running()  # begins with the first process else, and then unblocks Ctrl-C
    while running or (waiting and not over):
        while waiting and cores and not over:
            job, core, alone = waiting.pop(0), cores.pop(), ProcessPoolExecutor(1, spawn)
            signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # the new process inherits this, and hears in `_work`
            running[alone.submit(_work, job, core, os.getpid())] = job, alone, core
            signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        for one in wait(running, POLL_SECONDS, FIRST_COMPLETED).done:
            job, alone, core = running.pop(one)
            alone.shutdown()
            cores.append(core)
            error = one.exception()
            ending = one.result() if error is None else (STOPPED if over or asked() else _reason(error), None)
            over = over or ending[0] == STOPPED
            yield job, ending
        if asked() and not over:  # from a terminal the processes have heard of Ctrl-C as well, else only this one
            over = True
            for process in multiprocessing.active_children():
                process.terminate()


def _work(job: Job, core: int, parent: int) -> Ending:
    """Run one job on one core as a whole process, which stops early on Ctrl-C or when its parent is gone."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})  # two jobs whose threads share two cores disturb each other
    listen(says=False)
    with asked_to_stop(again=False, parent=parent):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        return job.run()


def on_slurm(jobs: Sequence[Job], logs: Path | None) -> Iterator[tuple[Job, Ending]]:
    """Run the jobs as arrays, one core each; the environment variables of `sbatch` say partition, time and memory.

    Neither the queue nor a file system shows at once what happens elsewhere. So a job is lost, and submitted again,
    after `_LOOKS_WHEN_LOST` looks that find it nowhere; the result of an earlier copy counts, too.
    """
    require_extra("slurm", "slurm")
    import submitit  # pyright: ignore[reportMissingImports]

    class Call(submitit.helpers.Checkpointable):  # pyright: ignore[reportUntypedBaseClass]
        """Runs a job, and is what a requeued one begins with."""

        def __call__(self, job: Job) -> Ending:
            with asked_to_stop(again=False):  # by scancel, a preemption or a requeue
                return job.run()

    refusals = submitit.core.utils.FailedSubmissionError, submitit.core.utils.FailedJobError
    waiting, copies = {job.name: job for job in jobs}, dict[str, list[Any]]()
    absences, losses, cancelled = Counter[str](), Counter[str](), False

    def cancel(names: Iterable[str]) -> None:
        _ask_slurm("scancel", *(copy.job_id for name in names for copy in copies[name]))

    passing = TemporaryDirectory(prefix=".apollonius-", dir=Path.cwd())  # where other machines find it, too
    with nullcontext(logs) if logs else passing as folder:
        executor = submitit.SlurmExecutor(Path(folder).absolute(), max_num_timeout=_RESTARTS)
        executor.update_parameters(job_name="apollonius", time=_SLURM_MINUTES, array_parallelism=len(jobs))
        try:
            for array in _arrays(jobs):
                submitted = zip(array, executor.map_array(Call(), array), strict=True)
                copies |= {job.name: [copy] for job, copy in submitted}
        except refusals as error:
            cancel(copies)
            raise InvalidInput(f"sbatch refuses the jobs ({error}): correct the SBATCH_... and go on.") from error
        while waiting:
            if asked() and not cancelled:
                cancelled = True
                cancel(waiting)
            queue = _ask_slurm("squeue", "-h", "-r", "-o", "%i", "-u", str(os.getuid()))
            for name in list(waiting) if queue is not None or cancelled else ():
                absent = [copy for copy in copies[name] if copy.job_id not in (queue or "").split()]
                over = [copy for copy in absent if copy.paths.result_pickle.exists()]
                endings = [(f"see {copy.paths.stderr}", None) if copy.exception() else copy.result() for copy in over]
                ending = min(endings, key=lambda ending: ending[0] != DONE, default=(STOPPED, None))
                absences[name] = absences[name] + 1 if len(absent) == len(copies[name]) else 0
                looks = 1 if cancelled or ending[0] != STOPPED else _LOOKS_WHEN_LOST  # what stops may be requeued
                if ending[0] != DONE and absences[name] < looks:
                    continue
                if losses[name] == _RESTARTS and not endings and not cancelled:
                    ending = f"it was lost {_RESTARTS + 1} times, see {copies[name][-1].paths.stderr}", None
                elif not endings and not cancelled:
                    absences[name] = 0
                    losses[name] += 1
                    with suppress(*refusals):  # it may be taken next time
                        copies[name].append(executor.submit(Call(), waiting[name]))
                    continue
                if losses[name]:
                    cancel([name])
                yield waiting.pop(name), ending
            for _ in range(_POLLS_PER_LOOK):
                if asked() and not cancelled:
                    break
                time.sleep(POLL_SECONDS)


def _arrays(jobs: Sequence[Job]) -> Iterator[Sequence[Job]]:
    """Yield the jobs in parts of which each is as large as an array on this cluster can be."""
    limit = re.search(r"MaxArraySize\s*=\s*(\d+)", _ask_slurm("scontrol", "show", "config") or "")
    most = max(1, int(limit[1])) if limit else len(jobs)
    return (jobs[first : first + most] for first in range(0, len(jobs), most))


def _ask_slurm(*command: str) -> str | None:
    """Return the output of a command of Slurm, or None if it fails."""
    try:
        return subprocess.run(command, capture_output=True, encoding="utf-8", errors="replace", check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return None


def on_ray(jobs: Sequence[Job], logs: Path | None) -> Iterator[tuple[Job, Ending]]:
    """Run as many jobs at a time as the cluster has cores: that of RAY_ADDRESS, or one that only this machine sees."""
    require_extra("ray", "ray")
    import ray  # pyright: ignore[reportMissingImports]
    from ray.exceptions import RayError  # pyright: ignore[reportMissingImports]

    own = {"num_cpus": len(available_cores()), "include_dashboard": False, "_node_ip_address": "127.0.0.1"}
    try:
        cluster = ray.init(**({} if "RAY_ADDRESS" in os.environ else own), log_to_driver=False)
    except Exception as error:  # of any kind, as on a machine too busy to start all parts in time
        raise InvalidInput(f"Ray does not start ({_reason(error)}): free a core, or correct RAY_ADDRESS.") from error
    with cluster:
        remote = ray.remote(num_cpus=1, max_retries=_RESTARTS)(Job.run)
        waiting = {remote.remote(job): job for job in jobs}
        while waiting and not asked():
            for one in ray.wait(list(waiting), timeout=POLL_SECONDS)[0]:
                try:
                    ending = ray.get(one)
                except RayError as error:
                    ending = _reason(error), None
                yield waiting.pop(one), ending
        for one, job in waiting.items():
            ray.cancel(one)
            yield job, (STOPPED, None)


WORKERS = {"processes": in_processes, "slurm": on_slurm, "ray": on_ray}
"""All kinds of workers, by name: each runs jobs and yields them with their endings; logs go to the folder."""
