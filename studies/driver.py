"""How every study runs: it trains what is missing, plays what is missing, and writes what it found.

Stopped or killed at any point, the same command goes on where it was: trainings have their checkpoints, and results are
kept as files beside all that they depend on.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar

from apollonius.compilations import keep_compilations
from apollonius.errors import require
from apollonius.game.by_side import BySide
from apollonius.jobs import ENGINES, STOPPED, Job, available_cores, run_jobs
from apollonius.learn.config import RunConfig
from apollonius.learn.trainings import train_runs
from apollonius.reproduce.finding import Finding, write_finding

LAST = BySide("P_curriculum", "E_curriculum")
"""What the agents are called that a run of self-play from given agents, or of both stages, ends with."""
Trainings = Mapping[Path, tuple[RunConfig, Sequence[str]]]
"""By folder: what to train, and which agents are there once it is finished."""


def option(default: Any = MISSING, **how: Any) -> Any:
    """A field that is an option of the study's command; without a default, an argument.

    Args:
        how: as `argparse.ArgumentParser.add_argument` has it; the type is that of the default, if not given.
    """
    return field(default=default, metadata=how)


@dataclass(frozen=True, kw_only=True)
class AbstractStudy:
    """What is trained, what is played, and what comes of it. The fields are the options of its command."""

    name: ClassVar[str]
    """That of its files, `NAME.json` and `NAME.md`, and of the folder that they are in by default."""
    out: Path
    games: int = option(1000, help="games in each match (default: %(default)s)")

    def trainings(self) -> Trainings:
        """All runs, finished or not. What could not be played afterwards is refused."""
        return {}

    def jobs(self) -> Iterator[Sequence[Job]]:
        """What is to be played yet once all is trained: groups of jobs, each of which needs those before it."""
        yield from ()

    def finding(self) -> Finding:
        """What it came to, once all is played. Draws its pictures."""
        raise NotImplementedError


def main(kind: type[AbstractStudy], arguments: Sequence[str] | None = None) -> int:
    """Run a study as a command; returns its exit status.

    Args:
        kind: the study; the docstring of its module says what it is about.
        arguments: of the command; None stands for those of the process.

    Raises:
        InvalidInput: for an option that cannot be, before anything is written; as `train_runs` and `run_jobs`.
    """
    parser = argparse.ArgumentParser(
        prog=f"python -m studies.{kind.name}",
        description=sys.modules[kind.__module__].__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--out", type=Path, default=Path("runs") / kind.name, help="folder (default: %(default)s)")
    for one in fields(kind):
        if one.default is not MISSING:
            how = {"type": str if one.default is None else type(one.default), **one.metadata}
            parser.add_argument(f"--{one.name.replace('_', '-')}", default=one.default, **how)
        elif one.metadata:
            parser.add_argument(one.name, **one.metadata)
    parser.add_argument("--processes", type=int, help="jobs at a time (default: one for each core)")
    parser.add_argument("--on", choices=ENGINES, default="local", help="where they run (default: %(default)s)")
    parser.add_argument("--only", choices=("train", "judge"), help="stop after training, or train nothing")
    options = parser.parse_args(arguments)
    for counted in ("games", "processes"):
        count = getattr(options, counted, None)
        require(count is None or count >= 1, f"--{counted}", count, "at least 1")
    options.out = options.out.absolute()
    study = kind(**{one.name: getattr(options, one.name) for one in fields(kind)})
    cores = available_cores()[: options.processes]
    keep_compilations()
    if options.only != "judge" and not train_runs(study.trainings(), cores, print, options.on):
        return STOPPED
    if options.only == "train":
        return 0
    for jobs in study.jobs():
        if not run_jobs(jobs, cores, print, options.on):
            return STOPPED
    finding = study.finding()
    write_finding(finding, study.out, kind.name)
    print(finding.text)
    return 0
