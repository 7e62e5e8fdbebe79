"""Trains what a study lacks: one process per core, each with a run of its own; a run that was stopped goes on."""

import multiprocessing
import os
import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing.queues import Queue
from pathlib import Path

from apollonius.errors import InvalidInput
from apollonius.experiments.study import RUN_OF, Study, run_configs
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import create_run, load_config


def train_missing(study: Study, cores: list[int], report: Callable[[str], None]) -> bool:
    """Train the runs of a study that are not finished, as many at a time as there are cores.

    Args:
        cores: numbers of the cores to use, a process each.
        report: called with a line whenever a run begins or ends.

    Returns:
        Whether all are finished; False after Ctrl-C, when every run has saved a checkpoint.

    Raises:
        InvalidInput: when a run's folder holds another training than the study's; before anything is trained.
    """
    runs = {
        study.run(name, seed): (config, name)
        for seed in study.seeds
        for name, config in run_configs(study.budget, seed).items()
    }
    missing = [folder for folder, (config, name) in runs.items() if not _is_finished(folder, config, name)]
    for folder in missing:
        if not folder.exists():
            create_run(runs[folder][0], folder)
    # A process that spawns inherits no threads of JAX; a forked one may hang.
    context = multiprocessing.get_context("spawn")
    free: Queue[int] = context.Queue()
    for core in cores:
        free.put(core)
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # each process stops by itself, then the pool is done
    try:
        with ProcessPoolExecutor(len(cores), context, initializer=_claim_core, initargs=(free,)) as pool:
            trainings = {pool.submit(_train, folder, os.getpid()): folder for folder in missing}
            report(f"{len(missing)} of {len(runs)} trainings to do, {len(cores)} at a time")
            finished = True
            for training in as_completed(trainings):
                done = training.result()
                finished = finished and done
                report(f"{'trained' if done else 'stopped'} {trainings[training]}")
    finally:
        signal.signal(signal.SIGINT, before)
    return finished


def _is_finished(folder: Path, config: RunConfig, name: str) -> bool:
    """Whether the agents of a run are there. Its config, where there is one, must be the study's."""
    if not (folder / "config.toml").is_file():
        return False
    if load_config(folder / "config.toml") != config:
        raise InvalidInput(f"'{folder}' holds another training than this study's: choose another --out or --budget.")
    agents = [agent for agent, run in RUN_OF.items() if run == name]
    return all((folder / "agents" / f"{agent}.safetensors").is_file() for agent in agents)


def _claim_core(free: "Queue[int]") -> None:
    """Run this process, and every thread it will start, on one core: two trainings on two cores disturb each other."""
    core = free.get()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})


def _train(folder: Path, parent: int) -> bool:
    """One run, from its checkpoint if it has one; stops early on Ctrl-C or when the parent process is gone."""
    from apollonius.learn.run import Run

    interrupted: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: interrupted.append(number))
    config = load_config(folder / "config.toml")
    return Run(config, folder, should_stop=lambda: bool(interrupted) or os.getppid() != parent).execute()
