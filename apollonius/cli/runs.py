"""`apollonius runs`: the training runs below a folder, and how far they are."""

import argparse
from dataclasses import asdict
from pathlib import Path

from apollonius.cli.options import add_json, answer
from apollonius.cli.values import runs_folder


def add_runs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "folder", type=runs_folder, nargs="?", default="runs", metavar="DIR", help="a folder of runs (default: runs)"
    )
    add_json(parser)
    parser.set_defaults(run=run_runs, compiles=False)


def run_runs(options: argparse.Namespace) -> int:
    from apollonius.cli.terminal import runs_table
    from apollonius.learn.progress import progress_of, runs_below

    folder: Path = options.folder
    found = [progress_of(run) for run in runs_below(folder)]
    facts = [asdict(run) | {"folder": str(run.folder)} for run in found]
    answer(options, {"runs": facts}, runs_table(found, folder))
    return 0
