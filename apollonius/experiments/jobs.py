"""Independent jobs, as many at a time as there are cores, each in a process of its own.

A job is a function that can be imported by its name, leaves its results in files and goes on where it was stopped.
"""

import multiprocessing
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any

from apollonius.errors import InvalidInput

STOPPED = 130
"""Exit status of a job that was stopped early."""
ShouldStop = Callable[[], bool]


@dataclass(frozen=True)
class Job:
    """What is to be done: `work(*arguments, should_stop)`, which returns whether it came to its end."""

    name: str
    work: Callable[..., bool]
    arguments: tuple[Any, ...]


def available_cores() -> list[int]:
    """Numbers of the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def run_jobs(jobs: Sequence[Job], cores: Sequence[int], report: Callable[[str], None]) -> bool:
    """Run all jobs, as many at a time as there are cores.

    Args:
        cores: numbers of the cores to use, a process each.
        report: called with a line whenever a job ends.

    Returns:
        Whether all came to their ends; False after Ctrl-C, when every job that was running has stopped by itself.

    Raises:
        InvalidInput: when a job fails, after the others that run beside it.
    """
    free: queue.SimpleQueue[int] = queue.SimpleQueue()
    for core in cores:
        free.put(core)
    over = threading.Event()

    def run(job: Job) -> bool:
        """One job in a process of its own, on a core that is free; none begins after one was stopped or failed."""
        if over.is_set():
            return False
        core = free.get()
        # A process that spawns inherits no threads of JAX; a forked one may hang.
        process = multiprocessing.get_context("spawn").Process(target=_work, args=(job, core, os.getpid()))
        process.start()
        process.join()
        free.put(core)
        if process.exitcode != 0:
            over.set()
        if process.exitcode not in (0, STOPPED):
            raise InvalidInput(f"{job.name} failed, see above: mend the cause and go on.")
        return process.exitcode == 0

    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # every process hears of Ctrl-C and stops by itself
    try:
        with ThreadPoolExecutor(len(cores)) as pool:
            running = {pool.submit(run, job): job for job in jobs}
            for future in as_completed(running):
                report(f"{'done' if future.result() else 'stopped'}: {running[future].name}")
            return not over.is_set()
    finally:
        signal.signal(signal.SIGINT, before)


def _work(job: Job, core: int, parent: int) -> None:
    """One job on one core; the whole life of a process. It stops early on Ctrl-C or when the parent process is gone."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})  # two jobs whose threads share two cores disturb each other
    interrupted: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: interrupted.append(number))
    try:
        finished = job.work(*job.arguments, lambda: bool(interrupted) or os.getppid() != parent)
    except (InvalidInput, OSError) as error:
        print(f"{job.name}: {error}", file=sys.stderr)
        sys.exit(2)
    sys.exit(0 if finished else STOPPED)
