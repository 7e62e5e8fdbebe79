"""The whole evaluation of the paper: train what is missing, play, draw, report."""

from collections.abc import Callable
from pathlib import Path

from apollonius.io.errors import InvalidInput, require
from apollonius.io.limits import SEEDS, STUDY_GAMES
from apollonius.io.workers import Job, Run, run_jobs
from apollonius.learn.config import PRESETS
from apollonius.learn.folder import agent_file, create_run, load_config
from apollonius.learn.run import train
from apollonius.reproduce.figures import figure_4, figure_5, figure_6, figure_7, figure_8, table_2, table_3
from apollonius.reproduce.finding import write_report
from apollonius.reproduce.study import Study

SECTIONS = (figure_4, figure_5, figure_6, figure_7, table_2, table_3, figure_8)
"""In the order of the report."""


def reproduce(
    folder: Path,
    budget: str,
    seeds: int,
    resume: bool,
    games: int = 10_000,
    report: Callable[[str], None] = print,
    run: Run = run_jobs,
) -> None:
    """Train the agents of seeds from 0 by a preset, make every section and write the report.

    Raises:
        KeyboardInterrupt: after Ctrl-C, once the trainings have stopped.
        InvalidInput: for an unknown budget, no seeds or no games, or a folder that holds something already where
            `resume` is not given.
    """
    require(budget in PRESETS, "budget", budget, f"one of {', '.join(PRESETS)}")
    SEEDS.require("seeds", seeds)
    STUDY_GAMES.require("games", games)
    STUDY_GAMES.require("games x seeds", games * seeds)
    is_new = not folder.exists() or not any(folder.iterdir())
    require(resume or is_new, "folder", folder, "a new one, as this one is not empty; choose another or resume it")
    folder.mkdir(parents=True, exist_ok=True)
    study = Study(folder, budget, PRESETS[budget], tuple(range(seeds)), games)
    _train_missing(study, report, run)
    findings = []
    for section in SECTIONS:
        findings.append(section(study))
        report(f"done: {findings[-1].title}")
    write_report(study, findings)


def _train_missing(study: Study, report: Callable[[str], None], run: Run) -> None:
    """Train the runs that are not finished, or resume them, several at a time.

    Raises:
        InvalidInput: when a run's folder holds another training than asked for, before anything is trained; when a
            training fails, after the others that run beside it.
    """
    missing: list[Path] = []
    for folder, (config, agents) in study.trainings().items():
        if not (folder / "config.toml").is_file():
            create_run(config, folder)
        elif load_config(folder / "config.toml") != config:
            raise InvalidInput(f"'{folder}' holds another training than this one: choose another folder.")
        if not all(agent_file(folder, agent).is_file() for agent in agents):
            missing.append(folder)
    report(f"{len(missing)} of {len(study.trainings())} trainings to do")
    run([Job(f"the training in '{one}'", train, (one.absolute(),)) for one in missing])
