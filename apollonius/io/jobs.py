"""Independent jobs, and processes of this machine that do them.

A job is a function that can be imported by its name, writes its results to files and resumes where it was stopped: it
may run anywhere and be started any number of times.
"""

import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.io.cache import keep_compilations
from apollonius.io.errors import InvalidInput
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

    Args:
        asked: asked again and again; True stops the jobs that are running, and none begins after that.
        logs: not used.
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
            _signals(signal.SIG_BLOCK)  # the new process inherits this, and hears when it can answer
            process.start()
            _signals(signal.SIG_UNBLOCK)
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


def _signals(how: int) -> None:
    """Block Ctrl-C and SIGTERM for the calling thread and the processes that it starts, or let them through."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(how, SIGNALS)


def _work(job: Job, core: int, parent: int) -> None:
    """Run one job on one core as a whole process, which stops early on Ctrl-C or when its parent is gone."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})  # two jobs whose threads share two cores disturb each other
    listen(says=False)
    with asked_to_stop(again=False) as asked:
        _signals(signal.SIG_UNBLOCK)
        ending = job.run(lambda: asked() or os.getppid() != parent)
    if ending not in (DONE, STOPPED):
        print(f"{job.name}: {ending}", file=sys.stderr)
        sys.exit(2)
    sys.exit(_STOPPED_STATUS if ending == STOPPED else 0)
