"""How a study runs: how many jobs at a time, where, and what they share."""

import argparse
import os
from pathlib import Path

from apollonius.errors import require
from apollonius.jobs import ENGINES, available_cores


def add_workers(parser: argparse.ArgumentParser) -> None:
    """The options of a study that say where its jobs run and how many at a time."""
    parser.add_argument("--processes", type=int, help="jobs at a time (default: one for each core)")
    parser.add_argument("--on", choices=ENGINES, default="local", help="where they run (default: %(default)s)")


def chosen_cores(processes: int | None, out: Path) -> list[int]:
    """The cores for as many jobs at a time, which share their compilations in a folder of `out`.

    Raises:
        InvalidInput: for fewer than one.
    """
    require(processes is None or processes >= 1, "--processes", processes, "at least 1")
    # The processes that do the work inherit this.
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(out / ".jax_cache"))
    return available_cores()[:processes]
