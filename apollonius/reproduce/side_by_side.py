"""Trainings that differ in their seeds only, side by side: a chunk of all is computed at once,
which pays on an accelerator.

The functions are those of `apollonius.learn`, mapped over the seeds; rounding differs from that of
one training alone. Each run has its own folder, with the files and the checkpoint of any training,
so that either way of training resumes what the other began.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from apollonius.agents.network import Network
from apollonius.arenas.file import to_dict
from apollonius.game.types import ROLES, BySide, Role
from apollonius.io.document import to_json
from apollonius.io.errors import InvalidInput, require
from apollonius.io.interrupts import should_stop, stopping_on_signals
from apollonius.io.limits import TRANSITIONS
from apollonius.learn.algorithm import ReplayAlgorithm
from apollonius.learn.config import RunConfig
from apollonius.learn.fixed_target import FixedTargetConfig
from apollonius.learn.folder import (
    CheckpointMeta,
    end_checkpoint,
    load_checkpoint,
    load_checkpoint_meta,
    load_config,
    save_checkpoint,
)
from apollonius.learn.metrics import append_metrics, begin_metrics, metrics_line
from apollonius.learn.progress import record_status
from apollonius.learn.replay_stage import ReplayStage, train_chunk
from apollonius.learn.run import (
    CHECKPOINT_SECONDS,
    CheckpointContent,
    TrainingRun,
    load_first_network,
)
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
    assert isinstance(config.algorithm, ReplayAlgorithm), "as these stages require"
    sides = max(len(stage.roles) for stage in config.stages)
    transitions = seeds * sides * config.algorithm.replay_capacity
    TRANSITIONS.require("seeds x transitions in replay buffers", transitions)


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
    groups: dict[str, list[SeedRun]] = {}
    for folder in folders:
        run = SeedRun(load_config(folder / "config.toml"), folder)
        if not run.meta.ended:
            groups.setdefault(run.place, []).append(run)
    for runs in groups.values():
        require_side_by_side(runs[0].config, len(runs))
    with stopping_on_signals(again=False):
        for runs in groups.values():
            if not SideBySide(runs).execute():
                raise KeyboardInterrupt
            for run in runs:
                report(f"done: the training in '{run.folder}'")


@dataclass(eq=False)
class SeedRun(TrainingRun):
    """One run among those side by side: how far it is, the networks that its stage started from,
    and the best ones of this stage so far, where it keeps them.
    """

    meta: CheckpointMeta = field(init=False)
    networks: BySide[Network | None] = field(init=False)
    best: dict[Role, Network] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.networks = ROLES.map(lambda role: load_first_network(self.config, role))
        self.meta = CheckpointMeta(next(iter(self.config.by_name)))
        self.resumes = self.checkpoint.exists()
        if self.resumes:
            self.meta = load_checkpoint_meta(self.checkpoint, self.config)

    @property
    def place(self) -> str:
        """The common parts of runs side by side: all but their seeds."""
        config = to_dict(replace(self.config, seed=0))
        return to_json([config, self.meta.stage, self.meta.chunks])

    def begin_metrics(self) -> None:
        """Make its `metrics.jsonl`, or cut off what was written after the checkpoint."""
        begin_metrics(self.metrics, self.meta if self.resumes else None)

    def key(self, name: str) -> jax.Array:
        """Return the random key of a stage."""
        return jax.random.fold_in(jax.random.key(self.config.seed), self.config.stage_number(name))

    def begin_stage(self, name: str, best: dict[Role, Network] | None) -> None:
        """Begin a stage, whose first agents are its best ones where it keeps these."""
        size = self.metrics.stat().st_size
        self.meta = CheckpointMeta(name, metrics_bytes=size)
        self.best = best

    def template(self, stage: ReplayStage) -> CheckpointContent:
        """Return the content of a checkpoint in this stage, with other numbers."""
        return self._template(self.meta.stage, stage)

    def load(self, template: CheckpointContent) -> TrainState:
        """Go on from the checkpoint; return its state."""
        content = load_checkpoint(self.checkpoint, template)
        self.networks, self.best = content.networks, content.best
        return content.train

    def save(self, train: TrainState) -> None:
        """Write the checkpoint."""
        content = CheckpointContent(train, self.networks, self.best)
        save_checkpoint(self.checkpoint, content, self.meta)

    def record(
        self, stage: ReplayStage, train: TrainState, metrics: Metrics, seconds: float
    ) -> None:
        """Evaluate and save the agents where that is due after a chunk, and write its metrics.

        Args:
            stage: The stage.
            train: The state after the chunk, of which the counters are read, and the agents where
                they are due.
            metrics: The chunk's.
            seconds: Time that the chunk took.
        """
        before = self.meta.chunks
        self.meta = replace(self.meta, chunks=before + 1, seconds=self.meta.seconds + seconds)
        evaluation = self._evaluate(stage, train, before, self.meta)
        if evaluation is not None and stage.config.keeps_best:
            best = self.meta.best.outcomes if self.meta.best else None
            if stage.is_better(evaluation.outcomes, best):
                self.best = stage.agents(train)
                self.meta = replace(self.meta, best=evaluation)
        self._save_snapshots(stage, train, before, self.meta)
        speed = stage.algorithm.env_steps_per_chunk / seconds
        line = metrics_line(self.meta.stage, train, metrics, evaluation, self.meta.seconds, speed)
        self.meta = replace(self.meta, metrics_bytes=append_metrics(self.metrics, line))

    def end_stage(self, stage: ReplayStage, last_agents: dict[Role, Network]) -> None:
        """Save the best agents where the stage keeps them; later stages start from them, or else
        from the last ones.
        """
        if self.best is not None and self.meta.best is not None:
            for role, network in self.best.items():
                self._save_agent(stage, network, role, asdict(self.meta.best), self.meta.stage)
        agents: dict[Role, Any] = self.best or last_agents
        self.networks = ROLES.map(lambda role: agents.get(role, self.networks[role]))


@dataclass(frozen=True)
class SideBySide:
    """Runs that differ in their seeds only and are equally far. Their states are stacked."""

    runs: Sequence[SeedRun]

    @property
    def first(self) -> SeedRun:
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
        names = list(self.first.config.by_name)
        resumed = self.first.meta.stage if self.first.resumes else None
        for name in names[names.index(self.first.meta.stage) :]:
            stage = self.first.make_stage(name)
            assert isinstance(stage, ReplayStage), "as `require_side_by_side` has checked"
            states = self._load(stage) if name == resumed else self._begin(name, stage)
            states, is_finished = self._train_stage(stage, states)
            if not is_finished:
                return False
            for number, run in enumerate(self.runs):
                run.end_stage(stage, _of_seed(stage.agents(states), number))
        for run in self.runs:
            end_checkpoint(run.checkpoint, run.config)
        return True

    def _begin(self, name: str, stage: ReplayStage) -> TrainState:
        keys = jnp.stack([run.key(name) for run in self.runs])
        networks = _stack([run.networks for run in self.runs])
        states = jax.jit(jax.vmap(stage.init))(keys, networks)
        for number, run in enumerate(self.runs):
            agents = _of_seed(stage.agents(states), number)
            run.begin_stage(name, agents if stage.config.keeps_best else None)
        return states

    def _load(self, stage: ReplayStage) -> TrainState:
        template = self.first.template(stage)
        return _stack([run.load(template) for run in self.runs])

    def _train_stage(self, stage: ReplayStage, states: TrainState) -> tuple[TrainState, bool]:
        """Train one stage from here. Returns its last states, and whether it ended by itself."""
        last_save, interval = time.monotonic(), CHECKPOINT_SECONDS
        while self.first.meta.chunks < stage.chunks:
            began = time.monotonic()
            states, metrics = train_chunks(stage, states)
            metrics = jax.device_get(metrics)
            self._record(stage, states, metrics, time.monotonic() - began)
            is_stopped, is_ended = should_stop(), self.first.meta.chunks == stage.chunks
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
        self, stage: ReplayStage, states: TrainState, metrics: Metrics, seconds: float
    ) -> None:
        """Record a chunk in each run. The agents are due at evaluations and, where they may be
        saved, at whole percentages of the stage.
        """
        before, after = self.first.meta.chunks, self.first.meta.chunks + 1
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
def train_chunks(stage: ReplayStage, states: TrainState) -> tuple[TrainState, Metrics]:
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
    )


def _counters(states: TrainState) -> TrainState:
    """Return states with nothing but their counters, read from the device at once."""
    small = _without_experience(states)
    is_counter = jax.tree.map(lambda leaf: leaf.ndim == 1 and leaf.dtype == jnp.int32, small)
    return jax.device_get(eqx.filter(small, is_counter))
