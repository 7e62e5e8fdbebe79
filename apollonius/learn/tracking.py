"""Experiment trackers: the records of `metrics.jsonl` sent to TensorBoard, Weights & Biases, MLflow or trackio.

The libraries are the user's, imported when one is asked for. Steps are the env steps of all stages together.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from apollonius.arenas.record import to_dict
from apollonius.io.errors import InvalidInput, require
from apollonius.learn.config import RunConfig
from apollonius.learn.metrics import MetricsLine

Sink = tuple[Callable[[dict[str, float], int], object], Callable[[], object]]
"""A function that takes the values of a record by name and their step, and one that is called at the end."""


def _tensorboard(folder: Path, config: dict[str, Any]) -> Sink:
    from tensorboardX import SummaryWriter  # pyright: ignore[reportMissingImports]

    writer = SummaryWriter(str(folder / "tensorboard"))

    def log(values: dict[str, float], step: int) -> None:
        for name, value in values.items():
            writer.add_scalar(name, value, step)

    return log, writer.close


def _mlflow(folder: Path, config: dict[str, Any]) -> Sink:
    import mlflow  # pyright: ignore[reportMissingImports]

    if "MLFLOW_EXPERIMENT_NAME" not in os.environ:
        mlflow.set_experiment("apollonius")
    mlflow.start_run(run_name=folder.name)
    mlflow.log_dict(config, "config.json")
    return mlflow.log_metrics, mlflow.end_run


def _wandb(folder: Path, config: dict[str, Any]) -> Sink:
    import wandb  # pyright: ignore[reportMissingImports]

    project = os.environ.get("WANDB_PROJECT", "apollonius")
    run = wandb.init(project=project, name=folder.name, config=config, dir=str(folder))
    return run.log, run.finish


def _trackio(folder: Path, config: dict[str, Any]) -> Sink:
    import trackio  # pyright: ignore[reportMissingImports]

    run = trackio.init(project="apollonius", name=folder.name, config=config, embed=False)
    return run.log, trackio.finish


TRACKERS = {"tensorboard": _tensorboard, "wandb": _wandb, "mlflow": _mlflow, "trackio": _trackio}
"""By name: the function that opens each."""


class Tracker:
    """A tracker of one training run, to be called with each of its records.

    Args:
        to: one of `TRACKERS`.

    Raises:
        InvalidInput: when the library is missing or refuses the run; when TensorBoard's files are there already.
    """

    def __init__(self, to: str, folder: Path, config: RunConfig) -> None:
        written = to == "tensorboard" and any(folder.glob("tensorboard/events.*"))
        require(not written, "tracker", to, f"another tracker, or remove '{folder / 'tensorboard'}', which is there")
        self._before, self._stage, self._steps = 0, "", 0
        try:
            self._log, self.close = TRACKERS[to](folder.resolve(), to_dict(config))
        except Exception as error:  # of any kind: each library has its own
            raise InvalidInput(f"{to} refuses the run ({error}): see its own settings.") from error

    def __call__(self, line: MetricsLine) -> None:
        """Send a record; outcomes as shares of the games."""
        if line.stage != self._stage:
            self._before, self._stage = self._before + self._steps, line.stage
        self._steps = line.env_steps
        plain = ("episodes", "updates", "env_steps_per_second", "pursuer_return", "evader_return")
        found = {name: float(getattr(line, name)) for name in plain}
        found |= {f"loss/{side}": loss for side, loss in line.losses.items()}
        judged = line.evaluation.outcomes if line.evaluation else {}
        for kind, outcomes in (("exploring", line.outcomes), ("greedy", judged)):
            games = sum(outcomes.values())
            found |= {f"{kind}/{name}": count / games for name, count in outcomes.items() if games}
        self._log({f"{line.stage}/{name}": value for name, value in found.items()}, self._before + self._steps)
