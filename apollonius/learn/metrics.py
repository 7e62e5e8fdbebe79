"""Metrics of a training run, the source of every curve: a line of `metrics.jsonl` for each chunk,
and trackers.

The libraries of TensorBoard, Weights & Biases, MLflow and trackio are the user's, imported when one
is asked for.
"""

import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from apollonius.arenas.file import from_dict, to_dict
from apollonius.game.outcome import counts_by_name, require_counts
from apollonius.io.document import parse_json, read_bytes, to_json
from apollonius.io.errors import TRACKERS, InvalidInput, require, require_within
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import CheckpointMeta, Evaluation
from apollonius.learn.stage import Metrics, TrainState

_MOST_BYTES = 2**27
"""Largest `metrics.jsonl` [bytes]: some 360,000 chunks."""
_LARGEST_MEAN = 1e12
"""Bound on mean returns and losses, beyond which a training has diverged."""


@dataclass(frozen=True)
class MetricsLine:
    """A line of `metrics.jsonl`: one chunk of training. Means are over finished games."""

    stage: str
    env_steps: int
    episodes: int
    updates: int
    seconds: float
    env_steps_per_second: int
    outcomes: dict[str, int]
    pursuer_return: float
    evader_return: float
    losses: dict[str, float]
    evaluation: Evaluation | None = None
    """The greedy evaluation at its end, if there was one."""

    def __post_init__(self) -> None:
        require_within(
            self, 0, 2**62, "env_steps", "episodes", "updates", "seconds", "env_steps_per_second"
        )
        require_counts(self.outcomes, "metrics")
        sides = set(self.losses)
        require(
            sides and sides <= {"pursuer", "evader"},
            "losses",
            ", ".join(sides),
            "those of pursuer and evader",
        )
        require_within(self, -_LARGEST_MEAN, _LARGEST_MEAN, "pursuer_return", "evader_return")
        worst = max(self.losses.values(), key=abs)
        require(abs(worst) <= _LARGEST_MEAN, "losses", worst, f"within {_LARGEST_MEAN:g} of 0")

    @property
    def games(self) -> int:
        """Games finished in the chunk."""
        return sum(self.outcomes.values())


def metrics_line(
    stage: str,
    train: TrainState,
    metrics: Metrics,
    evaluation: Evaluation | None,
    seconds: float,
    speed: float,
) -> MetricsLine:
    """Return the line of a chunk, after some seconds of the stage, at a speed in env steps per
    second; raises InvalidInput when the losses are beyond all bounds, so that the weights are no
    good.
    """
    outcomes, updates = counts_by_name(np.asarray(metrics.outcomes)), int(metrics.updates)
    games = max(1, sum(outcomes.values()))
    try:
        return MetricsLine(
            stage=stage,
            env_steps=int(train.env_steps),
            episodes=int(train.episodes),
            updates=int(next(iter(train.learners.values())).learner.updates),
            seconds=round(seconds, 2),
            env_steps_per_second=round(speed),
            outcomes=outcomes,
            pursuer_return=round(float(metrics.returns.pursuer) / games, 4),
            evader_return=round(float(metrics.returns.evader) / games, 4),
            losses={
                role.name.lower(): round(float(metrics.losses[role]) / max(1, updates), 6)
                for role in train.learners
            },
            evaluation=evaluation,
        )
    except InvalidInput as error:
        raise InvalidInput(
            f"the training has diverged ({error}): train again with a lower learning_rate."
        ) from error


def begin_metrics(path: Path, meta: CheckpointMeta | None = None) -> None:
    """Make an empty `metrics.jsonl`, or cut off what was written after a checkpoint.

    Raises InvalidInput when the checkpoint does not say where the line of its last chunk ends;
    nothing is cut off.
    """
    if meta is not None:
        chunks = [line.stage for line in load_metrics(path, meta.metrics_bytes)].count(meta.stage)
        bound = f"the {meta.chunks:,} that its checkpoint says; train again"
        require(chunks == meta.chunks, f"chunks of {meta.stage} in '{path}'", chunks, bound)
    with open(path, "ab") as file:
        file.truncate(meta.metrics_bytes if meta else 0)


def append_metrics(path: Path, line: MetricsLine) -> int:
    """Add a line to `metrics.jsonl`; return the file's size [bytes]."""
    with open(path, "a", encoding="utf-8") as file:
        file.write(
            to_json({name: value for name, value in asdict(line).items() if value is not None})
            + "\n"
        )
        file.flush()
        return file.tell()


def load_metrics(
    path: Path, size: int | None = None, within: Path | None = None
) -> list[MetricsLine]:
    """Return the lines of the first `size` bytes of a `metrics.jsonl`, or of all; none where there
    is no file. Raises InvalidInput for a bad one or a shorter one, and for one that is not `within`
    a folder, wherever links lead.
    """
    whole = (
        read_bytes(path, "a run's metrics", "train again", _MOST_BYTES, within)
        if path.exists()
        else b""
    )
    least = f"{size or 0:,} bytes at least, as its checkpoint says; train again"
    require(len(whole) >= (size or 0), f"'{path}'", f"{len(whole):,} bytes", least)
    lines = enumerate(whole[:size].splitlines(), start=1)
    return [_read_line(line, f"line {number} of '{path}'") for number, line in lines]


def last_lines(path: Path) -> tuple[MetricsLine | None, Evaluation | None]:
    """Return the last line of a `metrics.jsonl` that may be written to, and the last evaluation in
    it, if any.
    """
    content = (
        read_bytes(path, "a run's metrics", "train again", _MOST_BYTES) if path.exists() else b""
    )
    *whole, _ = content.split(b"\n")
    evaluated = [line for line in whole if b'"evaluation"' in line]
    last, judged = (
        _read_line(some[-1], f"'{path}'") if some else None for some in (whole, evaluated)
    )
    return last, judged and judged.evaluation


def _read_line(line: bytes, source: str) -> MetricsLine:
    return from_dict(
        MetricsLine, parse_json(line, f"{source} is no record of training; train again"), source
    )


def _open_tracker(
    to: str, folder: Path, config: dict[str, Any]
) -> tuple[Callable[..., object], Callable[[], object]]:
    """Begin a run of a tracker; return what takes values by name and their step, and what is called
    at the end.
    """
    tracker: Any = import_module(TRACKERS[to])
    if to == "tensorboard":
        writer = tracker.SummaryWriter(
            str(folder / to), purge_step=0
        )  # in place of what an earlier one has written
        return lambda values, step: [
            writer.add_scalar(*value, step) for value in values.items()
        ], writer.close
    if to == "mlflow":
        os.environ.setdefault("MLFLOW_EXPERIMENT_NAME", "apollonius")
        tracker.start_run(run_name=folder.name)
        tracker.log_dict(config, "config.json")
        return tracker.log_metrics, tracker.end_run
    os.environ.setdefault(
        "WANDB_DIR", str(folder)
    )  # its own files lie in the run, and not where one happens to be
    project = os.environ.get(
        f"{to.upper()}_PROJECT", "apollonius"
    )  # trackio is made to be used as wandb
    return tracker.init(project=project, name=folder.name, config=config).log, tracker.finish


class Tracker:
    """A run of tensorboard, wandb, mlflow or trackio, called with each record of a training."""

    def __init__(self, to: str, folder: Path, config: RunConfig) -> None:
        self._before = 0
        self._stage = ""
        self._steps = 0
        try:
            self._log, self.close = _open_tracker(to, folder.resolve(), to_dict(config))
        except Exception as error:  # of any kind: each library has its own
            raise InvalidInput(f"{to} refuses the run ({error}): see its own settings.") from error

    def __call__(self, line: MetricsLine) -> None:
        """Send a record at the env steps of all stages together; outcomes are shares of games."""
        if line.stage != self._stage:
            self._before, self._stage = self._before + self._steps, line.stage
        self._steps = line.env_steps
        plain = ("episodes", "updates", "env_steps_per_second", "pursuer_return", "evader_return")
        numbers = {name: float(getattr(line, name)) for name in plain}
        numbers |= {f"loss/{side}": loss for side, loss in line.losses.items()}
        judged = line.evaluation.outcomes if line.evaluation else {}
        for kind, outcomes in (("exploring", line.outcomes), ("greedy", judged)):
            games = sum(outcomes.values())
            numbers |= {
                f"{kind}/{name}": count / games for name, count in outcomes.items() if games
            }
        self._log(
            {f"{line.stage}/{name}": value for name, value in numbers.items()},
            self._before + self._steps,
        )
