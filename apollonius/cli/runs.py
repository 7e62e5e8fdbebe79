"""`apollonius runs`, `track` and `reproduce`: training runs as jobs, how far they are, and the
paper's.
"""

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from apollonius.cli.options import (
    LENGTHS,
    add_json,
    add_workers,
    print_next_step,
    print_result,
    shell_command,
)
from apollonius.cli.terminal import runs_table
from apollonius.cli.values import installed_extra, new_folder, run_folder, runs_folder, whole_number
from apollonius.io.errors import TRACKERS, require, require_extra
from apollonius.io.interrupts import set_resume_hint
from apollonius.io.limits import GAMES, SEEDS
from apollonius.io.workers import Job, run_jobs


def add_runs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "folder", type=runs_folder, nargs="?", default="runs", metavar="DIR", help="default: runs"
    )
    add_json(parser)
    parser.set_defaults(run=run_runs, compiles=False)


def add_track(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=run_folder, metavar="RUN", help="folder of a training run")
    parser.add_argument(
        "--to", type=installed_extra, choices=TRACKERS, required=True, help="the tracker"
    )
    parser.set_defaults(run=run_track, compiles=False)


def run_runs(options: argparse.Namespace) -> int:
    from apollonius.learn.progress import progress_of, runs_below

    folder: Path = options.folder
    runs = [progress_of(run) for run in runs_below(folder)]
    facts = [asdict(run) | {"folder": str(run.folder)} for run in runs]
    print_result(options, {"runs": facts}, runs_table(runs, folder))
    return 0


def run_track(options: argparse.Namespace) -> int:
    from apollonius.learn.folder import load_config
    from apollonius.learn.metrics import Tracker, load_metrics

    folder: Path = options.folder
    lines = load_metrics(folder / "metrics.jsonl")
    track = Tracker(options.to, folder, load_config(folder / "config.toml"))
    options.display.begin_task(f"sending {len(lines)} records")
    for number, line in enumerate(lines, start=1):
        track(line)
        options.display.report(number, len(lines))
    track.close()
    print_next_step(options, folder)
    return 0


def train_and_judge(folder: Path) -> bool:
    """Train the run of a folder, from its checkpoint if it has one, and judge it; return False if
    it was stopped.
    """
    from apollonius.evaluate.pairings import evaluate_run
    from apollonius.learn.folder import load_config
    from apollonius.learn.run import train

    config = load_config(folder / "config.toml")
    is_finished = train(folder)
    if is_finished and config.is_judged:
        evaluate_run(folder, config.game)
    return is_finished


def train_all(runs: Sequence[Path], folder: Path, options: argparse.Namespace) -> int:
    """Train and judge runs at or below a folder as jobs, and list how they ended."""
    from apollonius.learn.progress import mean_share, progress_of, runs_below

    display, on = options.display, options.on or "processes"
    set_resume_hint(f"go on with: {shell_command('resume', folder, '--on', on)}")
    display.begin_task(f"training {len(runs)} runs, on {on}", partial(mean_share, runs))
    jobs = [Job(str(run), train_and_judge, (run.absolute(),)) for run in runs]
    try:
        run_jobs(jobs, display.print_line, on, folder / "slurm")
    finally:
        display.stop()
        print(runs_table([progress_of(run) for run in runs_below(folder)], folder), flush=True)
    print_next_step(options, folder, then=shell_command("runs", folder))
    return 0


def add_reproduce(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--budget", choices=LENGTHS, default="quick", help="of each training (default: quick)"
    )
    parser.add_argument(
        "--seeds",
        type=whole_number(SEEDS),
        default=1,
        help="number of seeds, from 0 (default: %(default)s)",
    )
    parser.add_argument(
        "--games",
        type=whole_number(GAMES),
        default=10_000,
        help="games in a match (default: %(default)s)",
    )
    parser.add_argument(
        "--out", type=new_folder, help="folder of the study (default: runs/reproduce-BUDGET)"
    )
    add_workers(parser, "trainings", "processes")
    parser.add_argument(
        "--side-by-side",
        action="store_true",
        help="train all seeds in this process at once, which pays on an accelerator",
    )
    parser.add_argument("--resume", action="store_true", help="resume a study that was stopped")
    parser.set_defaults(run=run_reproduce)


def run_reproduce(options: argparse.Namespace) -> int:
    require_extra("plot", "reproduce")
    from apollonius.learn.config import PRESETS
    from apollonius.learn.progress import mean_share
    from apollonius.reproduce.reproduction import reproduce
    from apollonius.reproduce.side_by_side import require_side_by_side, train_side_by_side

    if options.side_by_side:
        bound = "left out with --side-by-side, which trains in this process"
        require(options.on == "processes", "--on", options.on, bound)
        require_side_by_side(PRESETS[options.budget], options.seeds)
    display = options.display
    folder: Path = options.out or Path("runs") / f"reproduce-{options.budget}"
    arguments = (
        "--budget",
        options.budget,
        "--seeds",
        options.seeds,
        "--out",
        folder,
        *(["--side-by-side"] if options.side_by_side else ["--on", options.on]),
    )
    set_resume_hint(f"go on with: {shell_command('reproduce', *arguments, '--resume')}")

    def run_all(jobs: Sequence[Job]) -> list[Any]:
        runs = [job.arguments[0] for job in jobs]
        display.begin_task("training", partial(mean_share, runs))
        if options.side_by_side:
            train_side_by_side(runs, print)
            return []
        return run_jobs(jobs, on=options.on, logs=folder / "slurm")

    reproduce(
        folder,
        options.budget,
        options.seeds,
        options.resume,
        options.games,
        run=run_all,
        begin=display.begin_task,
        progress=display.report,
    )
    then = shell_command("report", folder / "seed-0" / "curriculum")
    print_next_step(options, folder / "report.md", folder / "results.json", then=then)
    return 0
