"""Trains what a study lacks: one process per core, each with a run of its own; a run that was stopped goes on."""

import multiprocessing
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from apollonius.errors import InvalidInput
from apollonius.experiments.study import RUN_OF, Study, run_configs
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import agent_file, create_run, load_config

_STOPPED = 130
"""Exit status of a training that was stopped early."""


def train_missing(study: Study, cores: list[int], report: Callable[[str], None]) -> bool:
    """Train the runs of a study that are not finished, as many at a time as there are cores.

    Args:
        cores: numbers of the cores to use, a process each.
        report: called with a line whenever a run begins or ends.

    Returns:
        Whether all are finished; False after Ctrl-C, when every run has saved a checkpoint.

    Raises:
        InvalidInput: when a run's folder holds another training than the study's, before anything is trained; when a
            training fails, after the others that run beside it.
    """
    runs = {
        study.run(name, seed): (config, name)
        for seed in study.seeds
        for name, config in run_configs(study.preset, seed).items()
    }
    missing = [folder for folder, (config, name) in runs.items() if not _is_finished(folder, config, name)]
    for folder in missing:
        if not (folder / "config.toml").is_file():
            create_run(runs[folder][0], folder)
    free: queue.SimpleQueue[int] = queue.SimpleQueue()
    for core in cores:
        free.put(core)
    over = threading.Event()

    def train(folder: Path) -> bool:
        """One run in a process of its own, on a core that is free; none begins after one was stopped or failed."""
        if over.is_set():
            return False
        core = free.get()
        # A process that spawns inherits no threads of JAX; a forked one may hang.
        process = multiprocessing.get_context("spawn").Process(target=_train, args=(folder, core, os.getpid()))
        process.start()
        process.join()
        free.put(core)
        if process.exitcode != 0:
            over.set()
        if process.exitcode not in (0, _STOPPED):
            raise InvalidInput(f"the training in '{folder}' failed, see above: mend the cause and add --resume.")
        return process.exitcode == 0

    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # every process hears of Ctrl-C and stops by itself
    try:
        with ThreadPoolExecutor(len(cores)) as pool:
            trainings = {pool.submit(train, folder): folder for folder in missing}
            report(f"{len(missing)} of {len(runs)} trainings to do, {len(cores)} at a time")
            for training in as_completed(trainings):
                report(f"{'trained' if training.result() else 'stopped'} {trainings[training]}")
            return not over.is_set()
    finally:
        signal.signal(signal.SIGINT, before)


def _is_finished(folder: Path, config: RunConfig, name: str) -> bool:
    """Whether the agents of a run are there. Its config, where there is one, must be the study's."""
    if not (folder / "config.toml").is_file():
        return False
    if load_config(folder / "config.toml") != config:
        raise InvalidInput(f"'{folder}' holds another training than this study's: choose another --out or --budget.")
    agents = [agent for agent, run in RUN_OF.items() if run == name]
    return all(agent_file(folder, agent).is_file() for agent in agents)


def _train(folder: Path, core: int, parent: int) -> None:
    """One run on one core, from its checkpoint if it has one; the whole life of a process.

    It stops early on Ctrl-C or when the parent process is gone.
    """
    from apollonius.learn.run import Run

    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})  # two trainings whose threads share two cores disturb each other
    interrupted: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: interrupted.append(number))
    try:
        config = load_config(folder / "config.toml")
        finished = Run(config, folder, should_stop=lambda: bool(interrupted) or os.getppid() != parent).execute()
    except (InvalidInput, OSError) as error:
        print(f"{folder}: {error}", file=sys.stderr)
        sys.exit(2)
    sys.exit(0 if finished else _STOPPED)
