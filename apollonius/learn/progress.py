"""What a run tells while it goes on, and the file that keeps it: the truth behind every curve."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from apollonius.errors import require
from apollonius.game.outcome import counts_by_name
from apollonius.learn.checkpoint import Evaluation, Stand
from apollonius.learn.train_state import Plan, TrainState
from apollonius.learn.train_step import Metrics

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


def append_metrics(path: Path, progress: Progress, metrics: Metrics, seconds: float) -> int:
    """Add a line for one chunk to `metrics.jsonl`; returns the file's size [bytes]. Means are over finished games."""
    games = max(1, sum(progress.outcomes.values()))
    line = {
        "stage": progress.stage,
        "env_steps": progress.env_steps,
        "episodes": progress.episodes,
        "updates": progress.updates,
        "seconds": round(seconds, 2),
        "env_steps_per_second": round(progress.env_steps_per_second),
        "outcomes": progress.outcomes,
        "pursuer_return": round(float(metrics.returns.pursuer) / games, 4),
        "evader_return": round(float(metrics.returns.evader) / games, 4),
        "losses": progress.losses,
    }
    if progress.evaluation and progress.evaluation.env_steps == progress.env_steps:
        line["evaluation"] = asdict(progress.evaluation)
    with open(path, "a") as file:
        file.write(json.dumps(line) + "\n")
        file.flush()
        return file.tell()


def truncate_metrics(path: Path, size: int) -> None:
    """Cut off what was written after the checkpoint, or make an empty file.

    Raises:
        InvalidInput: when the file is shorter than that.
    """
    there = path.stat().st_size if path.exists() else 0
    require(there >= size, f"'{path}'", f"{there:,} bytes", f"{size:,} at least, as its checkpoint says; train again")
    with open(path, "ab") as file:
        file.truncate(size)


def last_metrics(path: Path) -> tuple[str | None, int]:
    """The stage of the last whole line of a `metrics.jsonl` and its env steps; None and 0 where there is none yet."""
    if not path.is_file():
        return None, 0
    with open(path, "rb") as file:
        file.seek(max(0, path.stat().st_size - _TAIL))
        whole = [line for line in file.read().splitlines(keepends=True) if line.startswith(b"{") and line[-1:] == b"\n"]
    line = json.loads(whole[-1]) if whole else {"stage": None, "env_steps": 0}
    return line["stage"], line["env_steps"]
