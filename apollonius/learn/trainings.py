"""Several trainings at a time; those that were stopped are resumed."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from apollonius.io.errors import InvalidInput
from apollonius.io.jobs import Job, ShouldStop, run_jobs
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import agent_file, create_run, load_config


def train_runs(
    runs: Mapping[Path, tuple[RunConfig, Sequence[str]]],
    cores: Sequence[int],
    report: Callable[[str], None],
    on: str = "local",
) -> bool:
    """Train the runs that are not finished, several at a time.

    Args:
        runs: by folder, what to train and which agents are there once it is finished.
        cores, on: as `run_jobs` has them.
        report: called with a line whenever a run begins or ends.

    Returns:
        Whether all are finished; False after Ctrl-C, when every run has saved a checkpoint.

    Raises:
        InvalidInput: when a run's folder holds another training than asked for, before anything is trained; when a
            training fails, after the others that run beside it.
    """
    missing = [folder for folder, (config, agents) in runs.items() if not _is_finished(folder, config, agents)]
    for folder in missing:
        if not (folder / "config.toml").is_file():
            create_run(runs[folder][0], folder)
    report(f"{len(missing)} of {len(runs)} trainings to do, {len(cores)} at a time")
    jobs = [Job(f"the training in '{folder}'", train, (folder.absolute(),)) for folder in missing]
    return run_jobs(jobs, cores, report, on)


def train(folder: Path, should_stop: ShouldStop) -> bool:
    """Train one run, from its checkpoint if it has one."""
    from apollonius.learn.run import Run

    return Run(load_config(folder / "config.toml"), folder, should_stop=should_stop).execute()


def _is_finished(folder: Path, config: RunConfig, agents: Sequence[str]) -> bool:
    """Return whether the agents of a run are there; its config, if any, must be the given one."""
    if not (folder / "config.toml").is_file():
        return False
    if load_config(folder / "config.toml") != config:
        raise InvalidInput(f"'{folder}' holds another training than this one: choose another folder.")
    return all(agent_file(folder, agent).is_file() for agent in agents)
