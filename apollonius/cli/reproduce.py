"""`apollonius reproduce`: the whole evaluation of the paper."""

import argparse
from functools import partial
from pathlib import Path

from apollonius.cli.options import LENGTHS, add_workers, command, finish
from apollonius.cli.values import count, new_folder
from apollonius.io.errors import require_extra
from apollonius.io.interrupts import go_on
from apollonius.io.limits import GAMES, SEEDS
from apollonius.io.workers import run_jobs


def add_reproduce(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--budget", choices=LENGTHS, default="quick",
        help="length of each training: quick (default), standard or paper",
    )  # fmt: skip
    parser.add_argument("--seeds", type=count(SEEDS), default=1, help="number of seeds, from 0 (default: %(default)s)")
    parser.add_argument("--games", type=count(GAMES), default=10_000, help="games in a match (default: %(default)s)")
    parser.add_argument("--out", type=new_folder, help="folder of the study (default: runs/reproduce-BUDGET)")
    add_workers(parser, "trainings")
    parser.add_argument("--resume", action="store_true", help="go on with a study that was stopped")
    parser.set_defaults(run=run_reproduce)


def run_reproduce(options: argparse.Namespace) -> int:
    require_extra("plot", "reproduce")
    from apollonius.reproduce.reproduction import reproduce

    folder: Path = options.out or Path("runs") / f"reproduce-{options.budget}"
    asked = ("--budget", options.budget, "--seeds", options.seeds, "--out", folder, "--on", options.on)
    display = options.display
    go_on(f"go on with: {command('reproduce', *asked, '--resume')}")

    display.begin("reproducing the paper")
    run = partial(run_jobs, on=options.on, logs=folder / "slurm")
    reproduce(folder, options.budget, options.seeds, options.resume, options.games, run=run)
    display.end()
    finish(folder / "report.md", folder / "results.json", then=command("report", folder / "seed-0" / "curriculum"))
    return 0
