"""What a run tells while it goes on, and the file that keeps it: the truth behind every curve."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from apollonius.arenas.record import from_dict
from apollonius.game.outcome import counts_by_name, require_counts
from apollonius.io.document import parse_json, read_bytes, to_json
from apollonius.io.errors import InvalidInput, require
from apollonius.learn.checkpoint import Evaluation, Stand
from apollonius.learn.train_state import Plan, TrainState
from apollonius.learn.train_step import Metrics

_MOST_BYTES = 2**24
"""Largest `metrics.jsonl` [bytes]: some 40,000 chunks."""
_LARGEST_MEAN = 1e12
"""Beyond this no mean reward of a game is, and no loss of a training that learns."""
_TAIL = 8192
"""Bytes in which the last line of metrics is looked for; a line has less than a thousand."""


@dataclass(frozen=True)
class Progress:
    """What a run tells while it goes on: where it stands, and the latest chunk."""

    stage: str
    env_steps: int
    total_env_steps: int
    episodes: int
    updates: int
    env_steps_per_second: float
    outcomes: dict[str, int]
    """Games finished in the latest chunk, by outcome; players explore."""
    losses: dict[str, float]
    """Mean loss of each learning side's updates in the latest chunk."""
    evaluation: Evaluation | None
    """The latest greedy evaluation, if there was one in this stage."""
    share: float
    """Part of the stage's work that is done, from 0 to 1: of the env steps that updates go with."""


def measure(stand: Stand, plan: Plan, train: TrainState, metrics: Metrics, speed: float) -> Progress:
    """The progress after a chunk.

    Args:
        stand: where the run stands after it.
        train: the state then.
        metrics: sums over the chunk.
        speed: env steps per second in the chunk.
    """
    updates, env_steps, total = int(metrics.updates), int(train.env_steps), plan.chunks * plan.env_steps_per_chunk
    idle = plan.learner.learning_starts if plan.learner.learning_starts < total else 0
    losses = {role.name.lower(): float(metrics.losses[role]) / max(1, updates) for role in train.learners}
    return Progress(
        stage=stand.stage,
        env_steps=env_steps,
        total_env_steps=total,
        episodes=int(train.episodes),
        updates=int(next(iter(train.learners.values())).learner.updates),
        env_steps_per_second=speed,
        outcomes=counts_by_name(np.asarray(metrics.outcomes)),
        losses={name: round(loss, 6) for name, loss in losses.items()},
        evaluation=stand.evaluation,
        share=max(0, env_steps - idle) / (total - idle),
    )


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
        for name in ("env_steps", "episodes", "updates", "seconds", "env_steps_per_second"):
            require(0 <= getattr(self, name) < 2**62, name, getattr(self, name), "0 or more")
        require_counts(self.outcomes, "metrics")
        sides = set(self.losses)
        require(sides and sides <= {"pursuer", "evader"}, "losses", ", ".join(sides), "those of pursuer and evader")
        means = {"pursuer_return": self.pursuer_return, "evader_return": self.evader_return, **self.losses}
        for name, mean in means.items():
            require(abs(mean) <= _LARGEST_MEAN, name, mean, f"within {_LARGEST_MEAN:g} of 0")

    @property
    def games(self) -> int:
        """Games finished in the chunk."""
        return sum(self.outcomes.values())


def begin_metrics(path: Path, stand: Stand | None = None) -> None:
    """Make an empty `metrics.jsonl`, or cut off what was written after the checkpoint.

    Args:
        stand: where the run stands by its checkpoint; None at its beginning.

    Raises:
        InvalidInput: when the checkpoint does not say where the line of its last chunk ends; nothing is cut off.
    """
    if stand is not None:
        chunks = [line.stage for line in load_metrics(path, stand.metrics_bytes)].count(stand.stage)
        bound = f"the {stand.chunks:,} that its checkpoint says; train again"
        require(chunks == stand.chunks, f"chunks of {stand.stage} in '{path}'", chunks, bound)
    with open(path, "ab") as file:
        file.truncate(stand.metrics_bytes if stand else 0)


def append_metrics(path: Path, progress: Progress, metrics: Metrics, seconds: float) -> int:
    """Add a line for one chunk to `metrics.jsonl`; return the file's size [bytes].

    Raises:
        InvalidInput: when the losses are beyond all bounds, so that the weights are no good.
    """
    games = max(1, sum(progress.outcomes.values()))
    ours = progress.evaluation and progress.evaluation.env_steps == progress.env_steps
    try:
        line = MetricsLine(
            stage=progress.stage,
            env_steps=progress.env_steps,
            episodes=progress.episodes,
            updates=progress.updates,
            seconds=round(seconds, 2),
            env_steps_per_second=round(progress.env_steps_per_second),
            outcomes=progress.outcomes,
            pursuer_return=round(float(metrics.returns.pursuer) / games, 4),
            evader_return=round(float(metrics.returns.evader) / games, 4),
            losses=progress.losses,
            evaluation=progress.evaluation if ours else None,
        )
    except InvalidInput as error:
        raise InvalidInput(f"the training has diverged ({error}): train again with a lower learning_rate.") from error
    with open(path, "a") as file:
        file.write(to_json({name: value for name, value in asdict(line).items() if value is not None}) + "\n")
        file.flush()
        return file.tell()


def load_metrics(path: Path, size: int | None = None, within: Path | None = None) -> list[MetricsLine]:
    """Return the lines of a `metrics.jsonl`; none where there is no file.

    Args:
        size: bytes from its beginning that are read; None for all.
        within: the folder that must contain the file, wherever links lead; None for any.

    Raises:
        InvalidInput: when it is too large or shorter than that, and for a line that training does not write.
    """
    whole = read_bytes(path, "a run's metrics", "train again", _MOST_BYTES, within) if path.exists() else b""
    least = f"{size or 0:,} bytes at least, as its checkpoint says; train again"
    require(len(whole) >= (size or 0), f"'{path}'", f"{len(whole):,} bytes", least)
    lines = enumerate(whole[:size].splitlines(), start=1)
    return [_read_line(line, f"line {number} of '{path}'") for number, line in lines]


def evaluations_of(lines: Sequence[MetricsLine], stage: str) -> list[Evaluation]:
    """Return the greedy evaluations in the course of a stage."""
    return [line.evaluation for line in lines if line.stage == stage and line.evaluation]


def last_metrics(path: Path) -> tuple[str | None, int]:
    """The stage of the last whole line of a `metrics.jsonl` and its env steps; None and 0 where there is none yet."""
    if not path.is_file():
        return None, 0
    with open(path, "rb") as file:
        file.seek(max(0, path.stat().st_size - _TAIL))
        whole = [line for line in file.read().splitlines(keepends=True) if line.startswith(b"{") and line[-1:] == b"\n"]
    line = _read_line(whole[-1], f"the last line of '{path}'") if whole else None
    return (line.stage, line.env_steps) if line else (None, 0)


def _read_line(line: bytes, source: str) -> MetricsLine:
    return from_dict(MetricsLine, parse_json(line, f"{source} is no record of training; train again"), source)
