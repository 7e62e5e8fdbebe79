"""Experiment trackers: the records of `metrics.jsonl` sent to TensorBoard, Weights & Biases, MLflow or trackio.

The libraries are the user's, imported when one is asked for. Steps are the env steps of all stages together.
"""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from apollonius.arenas.record import to_dict
from apollonius.io.errors import InvalidInput, require
from apollonius.learn.config import RunConfig
from apollonius.learn.metrics import MetricsLine

Log = Callable[[Mapping[str, float], int], None]
"""Takes the values of a record by name, and their step."""
Sink = tuple[Log, Callable[[], None]]
"""A log, and the function that closes it."""


def _tensorboard(folder: Path, name: str, config: dict[str, Any]) -> Sink:
    from tensorboardX import SummaryWriter  # pyright: ignore[reportMissingImports]

    writer = SummaryWriter(str(folder / "tensorboard"))

    def log(values: Mapping[str, float], step: int) -> None:
        for one, value in values.items():
            writer.add_scalar(one, value, step)

    return log, writer.close


def _mlflow(folder: Path, name: str, config: dict[str, Any]) -> Sink:
    import mlflow  # pyright: ignore[reportMissingImports]

    if "MLFLOW_EXPERIMENT_NAME" not in os.environ:
        mlflow.set_experiment("apollonius")
    mlflow.start_run(run_name=name)
    mlflow.log_dict(config, "config.json")
    return lambda values, step: mlflow.log_metrics(dict(values), step=step), mlflow.end_run


def _wandb(folder: Path, name: str, config: dict[str, Any]) -> Sink:
    import wandb  # pyright: ignore[reportMissingImports]

    project = os.environ.get("WANDB_PROJECT", "apollonius")
    run = wandb.init(project=project, name=name, config=config, dir=str(folder))
    return lambda values, step: run.log(dict(values), step=step), run.finish


def _trackio(folder: Path, name: str, config: dict[str, Any]) -> Sink:
    import trackio  # pyright: ignore[reportMissingImports]

    run = trackio.init(project="apollonius", name=name, config=config, embed=False)
    return lambda values, step: run.log(dict(values), step=step), trackio.finish


TRACKERS = {"tensorboard": _tensorboard, "wandb": _wandb, "mlflow": _mlflow, "trackio": _trackio}
"""By name: the function that opens each."""


class Tracker:
    """A run of a tracker, to be called with each record of a training.

    Args:
        to: one of `TRACKERS`.
        folder: of the training run.
        config: its configuration, which the tracker keeps.

    Raises:
        InvalidInput: when the library is missing or refuses the run; when TensorBoard's files are there already.
    """

    def __init__(self, to: str, folder: Path, config: RunConfig) -> None:
        written = to == "tensorboard" and any(folder.glob("tensorboard/events.*"))
        require(not written, "tracker", to, f"another tracker, or remove '{folder / 'tensorboard'}', which is there")
        self._before, self._stage, self._steps = 0, "", 0
        try:
            self._log, self.close = TRACKERS[to](folder, folder.resolve().name, to_dict(config))
        except Exception as error:  # of any kind: each library has its own
            raise InvalidInput(f"{to} refuses the run ({error}): see its own settings.") from error

    def __call__(self, line: MetricsLine) -> None:
        """Send a record."""
        if line.stage != self._stage:
            self._before, self._stage = self._before + self._steps, line.stage
        self._steps = line.env_steps
        self._log({f"{line.stage}/{name}": value for name, value in scalars(line).items()}, self._before + self._steps)


def scalars(line: MetricsLine) -> dict[str, float]:
    """Return the numbers of a record by name; outcomes are shares of the games."""
    plain = ("episodes", "updates", "env_steps_per_second", "pursuer_return", "evader_return")
    found = {name: float(getattr(line, name)) for name in plain}
    found |= {f"loss/{side}": loss for side, loss in line.losses.items()}
    judged = line.evaluation.outcomes if line.evaluation else {}
    for kind, outcomes in (("exploring", line.outcomes), ("greedy", judged)):
        games = sum(outcomes.values())
        found |= {f"{kind}/{name}": count / games for name, count in outcomes.items() if games}
    return found
