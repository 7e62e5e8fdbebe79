"""`apollonius track`: send the metrics of training runs to an experiment tracker."""

import argparse
from collections.abc import Callable, Generator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from apollonius.cli.options import finish
from apollonius.cli.values import run_folder, unfit
from apollonius.io.errors import EXTRAS

if TYPE_CHECKING:
    from apollonius.cli.display import Display
    from apollonius.learn.config import RunConfig
    from apollonius.learn.metrics import MetricsLine

MODULES = {"tensorboard": "tensorboardX", "wandb": "wandb", "mlflow": "mlflow", "trackio": "trackio"}
"""The module of each tracker."""


def tracker(text: str) -> str:
    """Return the name of a tracker, unless its library is not installed."""
    module = MODULES.get(text)
    if module and find_spec(module) is None:
        remedy = f"pip install {EXTRAS['track'][module]} (the extra 'track')"
        raise unfit(text, f"a tracker whose library is installed: {remedy}")
    return text


def add_tracker(parser: argparse.ArgumentParser, option: str, about: str) -> None:
    parser.add_argument(option, type=tracker, choices=MODULES, required=option == "--to", help=about)


def add_track(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=run_folder, metavar="RUN", help="folder of a training run")
    add_tracker(parser, "--to", "the tracker")
    parser.set_defaults(run=run_track, compiles=False)


def run_track(options: argparse.Namespace) -> int:
    from apollonius.learn.folder import load_config
    from apollonius.learn.metrics import load_metrics
    from apollonius.learn.tracking import Tracker

    folder: Path = options.folder
    lines = load_metrics(folder / "metrics.jsonl")
    tracker = Tracker(options.to, folder, load_config(folder / "config.toml"))
    options.display.begin(f"sending {len(lines)} records")
    for done, line in enumerate(lines, start=1):
        tracker(line)
        options.display.report(done, len(lines))
    tracker.close()
    options.display.end()
    finish(folder)
    return 0


@contextmanager
def tracked(
    to: str | None, config: "RunConfig", folder: Path, display: "Display"
) -> Generator[Callable[["MetricsLine"], None], None, None]:
    """Yield a function that sends a record to a tracker, if one is asked for; its errors end the sending alone."""
    from apollonius.learn.tracking import Tracker

    trackers = [Tracker(to, folder, config)] if to else []

    def send(line: "MetricsLine") -> None:
        for tracker in trackers:
            try:
                tracker(line)
            except Exception as error:  # of any kind: each library has its own
                trackers.clear()
                display.tell(f"{to} takes no more ({error}); apollonius track {folder} --to {to} sends all afterwards")

    try:
        yield send
    finally:
        for tracker in trackers:
            tracker.close()
