"""Trainings that differ in their seeds only, side by side: a chunk of all is computed at once,
which pays on an accelerator.

The functions are those of `apollonius.learn`, mapped over the seeds; rounding differs from that of
one training alone. Each run has its own folder, with the files and the checkpoint of any training,
so that either way of training resumes what the other began.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from apollonius.arenas.file import to_dict
from apollonius.io.document import to_json
from apollonius.io.errors import InvalidInput, require
from apollonius.io.interrupts import should_stop, stopping_on_signals
from apollonius.io.limits import TRANSITIONS
from apollonius.learn.config import RunConfig
from apollonius.learn.fixed_target import FixedTargetConfig
from apollonius.learn.folder import end_checkpoint, load_config
from apollonius.learn.progress import record_status
from apollonius.learn.rollout_stage import RolloutStage, train_chunk
from apollonius.learn.run import CHECKPOINT_SECONDS, TrainingRun
from apollonius.learn.self_play import SelfPlayConfig
from apollonius.learn.stage import Metrics, TrainState

_CHECKPOINT_SHARE = 0.05
"""Largest share of the time that checkpoints take: the replay buffers of all seeds are written."""


def require_side_by_side(config: RunConfig, seeds: int) -> None:
    """Refuse, by InvalidInput, trainings that cannot be mapped over seeds, and more than memory
    has room for.
    """
    for stage in config.stages:
        is_mapped = isinstance(stage, FixedTargetConfig) or (
            isinstance(stage, SelfPlayConfig) and not stage.has_earlier_versions
        )
        bound = "fixed-target, or self-play against the latest opponents; train the others alone"
        require(is_mapped, "stage side by side", stage.kind, bound)
    sides = max(len(stage.roles) for stage in config.stages)
    transitions = seeds * sides * config.algorithm.transitions
    TRANSITIONS.require("seeds x transitions kept", transitions)


def train_side_by_side(
    folders: Sequence[Path], report: Callable[[str], None] = lambda line: None
) -> None:
    """Train the runs of some folders, each from its checkpoint if any; those side by side that
    differ in their seeds only and are equally far.

    Args:
        folders: The folders, as `create_run` makes them.
        report: Called with a line whenever trainings end.

    Raises:
        InvalidInput: As `require_side_by_side`, and if a training fails.
        KeyboardInterrupt: After Ctrl-C, when checkpoints are written.
    """
    groups: dict[str, list[TrainingRun]] = {}
    for folder in folders:
        run = TrainingRun(load_config(folder / "config.toml"), folder)
        run.read_progress()
        if not run.progress.ended:
            groups.setdefault(_common_parts(run), []).append(run)
    for runs in groups.values():
        require_side_by_side(runs[0].config, len(runs))
    with stopping_on_signals(again=False):
        for runs in groups.values():
            if not SideBySide(runs).execute():
                raise KeyboardInterrupt
            for run in runs:
                report(f"done: the training in '{run.folder}'")


def _common_parts(run: TrainingRun) -> str:
    """Return the common parts of runs side by side: all but their seeds, and how far they are."""
    config = to_dict(replace(run.config, seed=0))
    return to_json([config, run.progress.stage, run.progress.chunks])


@dataclass(frozen=True)
class SideBySide:
    """Runs that differ in their seeds only and are equally far. Their states are stacked."""

    runs: Sequence[TrainingRun]

    @property
    def first(self) -> TrainingRun:
        """The run that stands for all where they are alike."""
        return self.runs[0]

    def execute(self) -> bool:
        """Train to the end of the last stage; return False if stopped early."""
        work = self._execute
        for run in self.runs:
            work = partial(record_status, run.folder, work)
        return work()

    def _execute(self) -> bool:
        for run in self.runs:
            run.begin_metrics()
        resumed = self.first.progress.stage if self.first.is_resumed else None
        for name in self.first.stages_left():
            stage = self.first.make_stage(name)
            assert isinstance(stage, RolloutStage), "as `require_side_by_side` has checked"
            states = self._load(stage) if name == resumed else self._begin(name, stage)
            states, is_finished = self._train_stage(stage, states)
            if not is_finished:
                return False
            for number, run in enumerate(self.runs):
                run.end_stage(stage, _of_seed(stage.agents(states), number))
        for run in self.runs:
            end_checkpoint(run.checkpoint, run.config)
        return True

    def _begin(self, name: str, stage: RolloutStage) -> TrainState:
        keys = jnp.stack([run.stage_key(name) for run in self.runs])
        networks = _stack([run.networks for run in self.runs])
        states = jax.jit(jax.vmap(stage.init))(keys, networks)
        for number, run in enumerate(self.runs):
            run.begin_stage(name, stage, _of_seed(stage.agents(states), number))
        return states

    def _load(self, stage: RolloutStage) -> TrainState:
        return _stack([run.load(stage) for run in self.runs])

    def _train_stage(self, stage: RolloutStage, states: TrainState) -> tuple[TrainState, bool]:
        """Train one stage from here. Returns its last states, and whether it ended by itself."""
        last_save, interval = time.monotonic(), CHECKPOINT_SECONDS
        while self.first.progress.chunks < stage.chunks:
            began = time.monotonic()
            states, metrics = train_chunks(stage, states)
            metrics = jax.device_get(metrics)
            self._record(stage, states, metrics, time.monotonic() - began)
            is_stopped, is_ended = should_stop(), self.first.progress.chunks == stage.chunks
            if is_stopped or is_ended or time.monotonic() - last_save >= interval:
                began = time.monotonic()
                for number, run in enumerate(self.runs):
                    run.save(_of_seed(states, number))
                last_save = time.monotonic()
                interval = max(CHECKPOINT_SECONDS, (last_save - began) / _CHECKPOINT_SHARE)
            if is_stopped and not is_ended:
                return states, False
        return states, True

    def _record(
        self, stage: RolloutStage, states: TrainState, metrics: Metrics, seconds: float
    ) -> None:
        """Record a chunk in each run. The agents are due at evaluations and, where they may be
        saved, at whole percentages of the stage.
        """
        before, after = self.first.progress.chunks, self.first.progress.chunks + 1
        is_percent = after * 100 // stage.chunks > before * 100 // stage.chunks
        needs_agents = is_percent or stage.evaluates(before, after)
        counters = _without_experience(states) if needs_agents else _counters(states)
        for number, run in enumerate(self.runs):
            own_metrics = _of_seed(metrics, number)
            try:
                run.record(stage, _of_seed(counters, number), own_metrics, seconds)
            except InvalidInput as error:
                raise InvalidInput(f"'{run.folder}': {error}") from error


@partial(jax.jit, donate_argnames="states")
def train_chunks(stage: RolloutStage, states: TrainState) -> tuple[TrainState, Metrics]:
    """Train a chunk of all runs. The states are consumed."""
    return jax.vmap(partial(train_chunk, stage))(states)


def _stack(trees: Sequence[Any]) -> Any:
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)


def _of_seed(tree: Any, number: int) -> Any:
    """Return the part of one run in what is stacked."""
    return jax.tree.map(lambda leaf: leaf[number], tree)


def _without_experience(states: TrainState) -> TrainState:
    """Return states without games and replay buffers."""
    return eqx.tree_at(
        lambda states: [states.games, *(side.buffer for side in states.learners.values())],
        states,
        replace_fn=lambda _: None,
        is_leaf=lambda leaf: leaf is None,
    )


def _counters(states: TrainState) -> TrainState:
    """Return states with nothing but their counters, read from the device at once."""
    small = _without_experience(states)
    is_counter = jax.tree.map(lambda leaf: leaf.ndim == 1 and leaf.dtype == jnp.int32, small)
    return jax.device_get(eqx.filter(small, is_counter))
