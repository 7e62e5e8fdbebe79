"""Independent jobs, and workers that do them: processes on this machine, a Slurm array, or a Ray
cluster.

A job is a function that can be imported by its name, writes its results to files and resumes where
it was stopped: it may run anywhere that has the same folders, and be started any number of times.
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
from apollonius.io.errors import LONGEST_MESSAGE, InvalidInput, format_value, require, require_extra
from apollonius.io.interrupts import SIGNALS, listen, should_stop, stopping_on_signals

DONE = "done"
STOPPED = "stopped"
"""Endings of jobs that did not fail; any other is the reason of a failure."""
POLL_SECONDS = 0.2
"""Time between two looks at whether to stop."""
_RESTARTS = 10
"""Most restarts of a job that reached its time limit on Slurm, or whose worker was lost."""
_POLLS_PER_LOOK = 15
"""Looks at whether to stop between two at Slurm's queue."""
_LOOKS_WHEN_LOST = 40
"""Looks in a row that find no trace of a lost job: two minutes, of which NFS may hide a new file
for one.
"""
_SLURM_MINUTES = 24 * 60
"""Time limit of a Slurm job, unless SBATCH_TIMELIMIT says another; a job that reaches it is
requeued.
"""
Ending = tuple[str, Any]
"""The ending of a job, and the value that it returned."""


@dataclass(frozen=True)
class Job:
    """A call, which returns its result, or False if it stopped early (`should_stop`)."""

    name: str
    work: Callable[..., Any]
    arguments: tuple[Any, ...]

    def run(self) -> Ending:
        """Run the job in this process; it ends `DONE`, `STOPPED`, or with the line of a refusal."""
        keep_compilations()
        try:
            result = self.work(*self.arguments)
            return STOPPED if result is False else DONE, result
        except KeyboardInterrupt:
            return STOPPED, None
        except (InvalidInput, OSError) as error:
            return _reason(error), None


def _reason(error: BaseException) -> str:
    """Describe an error; some, such as a MemoryError, have a name and no words."""
    return format_value(str(error) or type(error).__name__, LONGEST_MESSAGE)


JobRunner = Callable[[Sequence[Job]], list[Any]]
"""From jobs to their results, as `run_jobs` with its other arguments."""


def run_jobs(
    jobs: Sequence[Job],
    report: Callable[[str], None] = print,
    on: str = "processes",
    logs: Path | None = None,
) -> list[Any]:
    """Run all jobs and return their results; a failure does not end the other jobs.

    Args:
        jobs: The jobs.
        report: Called with a line whenever a job ends.
        on: One of `WORKERS`.
        logs: Folder for the output of jobs on Slurm.

    Raises:
        KeyboardInterrupt: After Ctrl-C, when every job has stopped.
        InvalidInput: If jobs failed, after all others; if a library or Slurm is missing.
    """
    require(on in WORKERS, "on", on, f"one of {', '.join(WORKERS)}")
    results = dict[str, Any]()
    failures = list[str]()
    is_stopped = False
    with stopping_on_signals(again=False):
        for job, (ending, result) in WORKERS[on](jobs, logs) if jobs else ():
            results[job.name] = result
            is_stopped = is_stopped or ending == STOPPED
            if ending in (DONE, STOPPED):
                report(f"{ending}: {job.name}")
            else:
                failures.append(job.name)
                report(f"failed: {job.name} ({ending})")
    if failures:
        names = ", ".join(failures)
        counts = f"{len(failures)} of {len(jobs)} failed"
        raise InvalidInput(f"{counts} ({names}): mend the cause and go on.")
    if is_stopped or len(results) < len(jobs):
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

    # which inherits no threads of JAX; a forked process may hang
    spawn = multiprocessing.get_context("spawn")
    queue = list(jobs)
    cores = available_cores()
    is_stopping = False
    running: dict[Any, tuple[Job, ProcessPoolExecutor, int]] = {}
    # begins with the first process else, and then unblocks Ctrl-C
    resource_tracker.ensure_running()
    while running or (queue and not is_stopping):
        while queue and cores and not is_stopping:
            job = queue.pop(0)
            core = cores.pop()
            executor = ProcessPoolExecutor(1, spawn)
            # The new process inherits this, and unblocks signals in `_work`.
            signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
            running[executor.submit(_work, job, core, os.getpid())] = job, executor, core
            signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        for future in wait(running, POLL_SECONDS, FIRST_COMPLETED).done:
            job, executor, core = running.pop(future)
            executor.shutdown()
            cores.append(core)
            error = future.exception()
            if error is None:
                ending = future.result()
            elif is_stopping or should_stop():
                ending = STOPPED, None
            else:
                ending = _reason(error), None
            is_stopping = is_stopping or ending[0] == STOPPED
            yield job, ending
        # Ctrl-C in a terminal reaches all processes, else only this one
        if should_stop() and not is_stopping:
            is_stopping = True
            for process in multiprocessing.active_children():
                process.terminate()


def _work(job: Job, core: int, parent: int) -> Ending:
    """Run one job on one core as a whole process, which stops early on Ctrl-C or when its parent is
    gone.
    """
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})  # two jobs whose threads share two cores disturb each other
    listen(says=False)
    with stopping_on_signals(again=False, parent=parent):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        return job.run()


def on_slurm(jobs: Sequence[Job], logs: Path | None) -> Iterator[tuple[Job, Ending]]:
    """Run the jobs as arrays, one core each; the environment variables of `sbatch` say partition,
    time and memory.

    Neither the queue nor a file system shows at once what happens elsewhere. So a job is lost, and
    submitted again, after `_LOOKS_WHEN_LOST` looks that find it nowhere; the result of an earlier
    copy counts, too.
    """
    require_extra("slurm", "slurm")
    import submitit  # pyright: ignore[reportMissingImports]

    # where other machines find it, too
    passing = TemporaryDirectory(prefix=".apollonius-", dir=Path.cwd())
    with nullcontext(logs) if logs else passing as folder:
        executor = submitit.SlurmExecutor(Path(folder).absolute(), max_num_timeout=_RESTARTS)
        executor.update_parameters(
            job_name="apollonius", time=_SLURM_MINUTES, array_parallelism=len(jobs)
        )
        slurm_jobs = _SlurmJobs(executor, jobs)
        slurm_jobs.submit_all()
        while slurm_jobs.unfinished:
            slurm_jobs.cancel_if_asked()
            queue = _ask_slurm("squeue", "-h", "-r", "-o", "%i", "-u", str(os.getuid()))
            if queue is not None or slurm_jobs.are_cancelled:
                running = (queue or "").split()
                for name in list(slurm_jobs.unfinished):
                    ending = slurm_jobs.look(name, running)
                    if ending is not None:
                        yield slurm_jobs.unfinished.pop(name), ending
            for _ in range(_POLLS_PER_LOOK):
                if should_stop() and not slurm_jobs.are_cancelled:
                    break
                time.sleep(POLL_SECONDS)


class _SlurmJobs:
    """Jobs that have been submitted to Slurm.

    Attributes:
        unfinished: the jobs that have not ended, by name.
        are_cancelled: whether they have been asked to stop.
    """

    def __init__(self, executor: Any, jobs: Sequence[Job]) -> None:
        import submitit  # pyright: ignore[reportMissingImports]

        class Call(submitit.helpers.Checkpointable):  # pyright: ignore[reportUntypedBaseClass]
            """Checkpointable call of a job for submitit."""

            def __call__(self, job: Job) -> Ending:
                with stopping_on_signals(again=False):  # by scancel, a preemption or a requeue
                    return job.run()

        errors = submitit.core.utils
        self._refusals = errors.FailedSubmissionError, errors.FailedJobError
        self._executor = executor
        self._call = Call()
        self.unfinished = {job.name: job for job in jobs}
        self.are_cancelled = False
        self._copies = dict[str, list[Any]]()
        self._absences = Counter[str]()
        self._losses = Counter[str]()

    def submit_all(self) -> None:
        """Submit all jobs; raises InvalidInput if Slurm refuses any, and then cancels the
        others.
        """
        try:
            for array in _arrays(list(self.unfinished.values())):
                submitted = zip(array, self._executor.map_array(self._call, array), strict=True)
                self._copies |= {job.name: [copy] for job, copy in submitted}
        except self._refusals as error:
            self._cancel(self._copies)
            remedy = "correct the SBATCH_... and go on"
            raise InvalidInput(f"sbatch refuses the jobs ({error}): {remedy}.") from error

    def cancel_if_asked(self) -> None:
        """Cancel the unfinished jobs, once, if this process is to stop."""
        if should_stop() and not self.are_cancelled:
            self.are_cancelled = True
            self._cancel(self.unfinished)

    def look(self, name: str, running: Sequence[str]) -> Ending | None:
        """Look for a job's copies among these in the queue; return its ending, or None before it.

        A lost job is submitted again, up to `_RESTARTS` times.
        """
        copies = self._copies[name]
        absent = [copy for copy in copies if copy.job_id not in running]
        finished = [copy for copy in absent if copy.paths.result_pickle.exists()]
        endings = [_slurm_ending(copy) for copy in finished]
        ending = min(endings, key=lambda ending: ending[0] != DONE, default=(STOPPED, None))
        self._absences[name] = self._absences[name] + 1 if len(absent) == len(copies) else 0
        # what stops may be requeued
        is_final = self.are_cancelled or ending[0] != STOPPED
        most_absences = 1 if is_final else _LOOKS_WHEN_LOST
        if ending[0] != DONE and self._absences[name] < most_absences:
            return None
        is_lost = not endings and not self.are_cancelled
        if is_lost and self._losses[name] < _RESTARTS:
            self._submit_again(name)
            return None
        if is_lost:
            ending = f"it was lost {_RESTARTS + 1} times, see {copies[-1].paths.stderr}", None
        if self._losses[name]:
            self._cancel([name])
        return ending

    def _submit_again(self, name: str) -> None:
        self._absences[name] = 0
        self._losses[name] += 1
        with suppress(*self._refusals):  # it may be taken next time
            self._copies[name].append(self._executor.submit(self._call, self.unfinished[name]))

    def _cancel(self, names: Iterable[str]) -> None:
        _ask_slurm("scancel", *(copy.job_id for name in names for copy in self._copies[name]))


def _slurm_ending(copy: Any) -> Ending:
    """Return the ending of a finished copy of a job on Slurm."""
    return (f"see {copy.paths.stderr}", None) if copy.exception() else copy.result()


def _arrays(jobs: Sequence[Job]) -> Iterator[Sequence[Job]]:
    """Yield the jobs in parts of which each is as large as an array on this cluster can be."""
    limit = re.search(r"MaxArraySize\s*=\s*(\d+)", _ask_slurm("scontrol", "show", "config") or "")
    most = max(1, int(limit[1])) if limit else len(jobs)
    return (jobs[first : first + most] for first in range(0, len(jobs), most))


def _ask_slurm(*command: str) -> str | None:
    """Return the output of a command of Slurm, or None if it fails."""
    try:
        result = subprocess.run(
            command, capture_output=True, encoding="utf-8", errors="replace", check=True
        )
        return result.stdout
    except (OSError, subprocess.CalledProcessError):
        return None


def on_ray(jobs: Sequence[Job], logs: Path | None) -> Iterator[tuple[Job, Ending]]:
    """Run as many jobs at a time as the cluster has cores: RAY_ADDRESS's, or one on this machine
    only.
    """
    require_extra("ray", "ray")
    import ray  # pyright: ignore[reportMissingImports]
    from ray.exceptions import RayError  # pyright: ignore[reportMissingImports]

    own = {
        "num_cpus": len(available_cores()),
        "include_dashboard": False,
        "_node_ip_address": "127.0.0.1",
    }
    try:
        cluster = ray.init(**({} if "RAY_ADDRESS" in os.environ else own), log_to_driver=False)
    except Exception as error:  # of any kind, as on a machine too busy to start all parts in time
        remedy = "free a core, or correct RAY_ADDRESS"
        raise InvalidInput(f"Ray does not start ({_reason(error)}): {remedy}.") from error
    with cluster:
        remote = ray.remote(num_cpus=1, max_retries=_RESTARTS)(Job.run)
        jobs_by_task = {remote.remote(job): job for job in jobs}
        while jobs_by_task and not should_stop():
            for task in ray.wait(list(jobs_by_task), timeout=POLL_SECONDS)[0]:
                try:
                    ending = ray.get(task)
                except RayError as error:
                    ending = _reason(error), None
                yield jobs_by_task.pop(task), ending
        for task, job in jobs_by_task.items():
            ray.cancel(task)
            yield job, (STOPPED, None)


WORKERS = {"processes": in_processes, "slurm": on_slurm, "ray": on_ray}
"""All kinds of workers, by name: each runs jobs and yields them with their endings; logs go to the
folder.
"""
