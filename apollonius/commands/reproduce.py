"""`apollonius reproduce`: the whole evaluation of the paper."""

import argparse
import sys
from pathlib import Path
from typing import Any

from apollonius.commands.options import INTERRUPTED, PLACES, PLACES_HELP, plots


def add_reproduce(subparsers: Any) -> None:
    """The parser of `reproduce`."""
    parser = subparsers.add_parser("reproduce", help="train, evaluate and draw all that the paper shows")
    parser.add_argument("--budget", default="quick", help="length of each training: quick (default), standard or paper")
    parser.add_argument("--seeds", type=int, default=1, help="number of seeds, from 0 (default: %(default)s)")
    parser.add_argument("--games", type=int, default=10_000, help="games in a match (default: %(default)s)")
    parser.add_argument("--out", type=Path, help="folder of the study (default: runs/reproduce-BUDGET)")
    parser.add_argument("--on", choices=PLACES, default="local", help=PLACES_HELP)
    parser.add_argument("--resume", action="store_true", help="go on with a study that was stopped")
    parser.set_defaults(run=run_reproduce)


def run_reproduce(options: argparse.Namespace) -> int:
    """Reproduce the paper's evaluation."""
    with plots():
        from apollonius.experiments.reproduce import reproduce

    folder: Path = options.out or Path("runs") / f"reproduce-{options.budget}"
    again = f"apollonius reproduce --budget {options.budget} --seeds {options.seeds} --out {folder} --resume"
    if not reproduce(folder, options.budget, options.seeds, options.resume, options.games, on=options.on):
        print(f"stopped; go on with: {again}", file=sys.stderr)
        return INTERRUPTED
    print(f"the report is {folder / 'report.md'}, its numbers are in {folder / 'results.json'}")
    return 0
