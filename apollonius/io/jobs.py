"""Independent jobs, each in a process of its own: on the cores of this machine, or on the workers of a Ray cluster.

A job is a function that can be imported by its name, writes its results to files and resumes where it was stopped: it
may run anywhere and be started any number of times.
"""

import os
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from apollonius.io.cache import keep_compilations
from apollonius.io.errors import InvalidInput, require, require_extra
from apollonius.io.interrupts import SIGNALS, asked_to_stop, listen

if TYPE_CHECKING:
    from multiprocessing.context import SpawnProcess

LOST_WORKERS = 10
"""Most restarts by Ray of a job whose worker was lost."""
STOPPED = 130
"""Exit status of a job that was stopped early."""
_ENDS = {0, STOPPED, *(128 + number for number in SIGNALS), *(-number for number in SIGNALS)}
"""Exit statuses of jobs that did not fail; signals may reach them again while they leave."""
_POLL_SECONDS = 0.2
"""Time between two looks at whether to stop."""


@dataclass(frozen=True)
class Job:
    """A call `work(*arguments, should_stop)`, which returns whether it finished."""

    name: str
    work: Callable[..., bool]
    arguments: tuple[Any, ...]


def available_cores() -> list[int]:
    """Return the numbers of the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def run_jobs(jobs: Sequence[Job], cores: Sequence[int], report: Callable[[str], None], on: str = "local") -> bool:
    """Run all jobs.

    Args:
        cores: numbers of the cores of this machine to use, a process each.
        report: called with a line whenever a job ends.
        on: `local`, or `ray` for the Ray cluster that is running or else a new one of these cores.

    Returns:
        Whether all came to their ends; False after Ctrl-C, when every job that was running has stopped by itself.

    Raises:
        InvalidInput: when a job fails, after the others that run beside it; when Ray is not installed.
    """
    require(on in ENGINES, "on", on, f"one of {', '.join(ENGINES)}")
    return ENGINES[on](jobs, cores, report) if jobs else True


def _run_locally(jobs: Sequence[Job], cores: Sequence[int], report: Callable[[str], None]) -> bool:
    """Run as many at a time as there are cores; none begins after one was stopped or failed.

    Where one process is killed, a `ProcessPoolExecutor` ends all jobs and names none; one for each job is no shorter.
    """
    import multiprocessing
    from multiprocessing import connection, resource_tracker

    spawn = multiprocessing.get_context("spawn")  # which inherits no threads of JAX; a forked process may hang
    waiting, free, failed, over, told = list(jobs), list(cores), list[str](), False, False
    running: dict[int, tuple[Job, SpawnProcess, int]] = {}
    resource_tracker.ensure_running()  # begins with the first process else, and then unblocks Ctrl-C
    with asked_to_stop(again=False) as asked:
        while running or (waiting and not over):
            while waiting and free and not over:
                job, core = waiting.pop(0), free.pop()
                process = spawn.Process(target=_work, args=(job, core, os.getpid()))
                _signals(signal.SIG_BLOCK)  # the new process inherits this, and hears when it can answer
                process.start()
                _signals(signal.SIG_UNBLOCK)
                running[process.sentinel] = job, process, core
            for ended in connection.wait(list(running), timeout=_POLL_SECONDS):
                assert isinstance(ended, int)
                job, process, core = running.pop(ended)
                process.join()
                free.append(core)
                over = over or process.exitcode != 0
                if process.exitcode in _ENDS:
                    report(f"{'stopped' if process.exitcode else 'done'}: {job.name}")
                else:
                    failed.append(job.name)
            if asked() and not told:  # from a terminal the processes have heard of Ctrl-C as well, else only this one
                over = told = True
                for _, process, _ in running.values():
                    process.terminate()
    if failed:
        raise InvalidInput(f"{failed[0]} failed, see above: mend the cause and go on.")
    return not over


def _signals(how: int) -> None:
    """Block Ctrl-C and SIGTERM for the calling thread and the processes that it starts, or let them through."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(how, SIGNALS)


def _run_on_ray(jobs: Sequence[Job], cores: Sequence[int], report: Callable[[str], None]) -> bool:
    """Run as many at a time as the cluster has cores.

    The job of a lost worker is resumed on another one from its files: all machines must see the same folders.
    """
    require_extra("ray", "ray")
    import ray  # pyright: ignore[reportMissingImports]
    from ray.exceptions import RayError  # pyright: ignore[reportMissingImports]

    ours = not ray.is_initialized()
    if ours:
        running = "RAY_ADDRESS" in os.environ
        ray.init(**{} if running else {"num_cpus": len(cores), "include_dashboard": False}, log_to_driver=False)
    try:
        remote = ray.remote(num_cpus=1, max_retries=LOST_WORKERS)(_work_on_ray)
        waiting = {remote.remote(job): job for job in jobs}
        while waiting:
            (done, *_), _ = ray.wait(list(waiting))
            job = waiting.pop(done)
            try:
                complaint = ray.get(done)
            except RayError as error:
                raise InvalidInput(f"{job.name} failed ({error}): mend the cause and go on.") from error
            if complaint:
                raise InvalidInput(f"{job.name} failed ({complaint}): mend the cause and go on.")
            report(f"done: {job.name}")
        return True
    except KeyboardInterrupt:
        return False
    finally:
        if ours:
            ray.shutdown()


def _work_on_ray(job: Job) -> str:
    """Run a job on a Ray worker and return its error as text; a job that Ray ends is resumed from its files."""
    try:
        finished = job.work(*job.arguments, lambda: False)
    except (InvalidInput, OSError) as error:
        return str(error)
    return "" if finished else "it stopped early"


ENGINES = {"local": _run_locally, "ray": _run_on_ray}
"""Where jobs can run."""


def _work(job: Job, core: int, parent: int) -> None:
    """Run one job on one core as a whole process, which stops early on Ctrl-C or when its parent is gone."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})  # two jobs whose threads share two cores disturb each other
    keep_compilations()
    listen(says=False)
    try:
        with asked_to_stop(again=False) as asked:
            _signals(signal.SIG_UNBLOCK)
            finished = job.work(*job.arguments, lambda: asked() or os.getppid() != parent)
    except (InvalidInput, OSError) as error:
        print(f"{job.name}: {error}", file=sys.stderr)
        sys.exit(2)
    sys.exit(0 if finished else STOPPED)
