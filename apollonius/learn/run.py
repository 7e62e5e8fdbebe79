"""A training run in a folder: the stages in their order, metrics, agents, checkpoints, exact
resume.

All that decides the final weights is in the config and the checkpoint. When checkpoints are written
does not matter, so they follow the clock: a run that is killed and resumed ends with the same bits
as one that is not.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.store import describe, save_agent
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import to_dict
from apollonius.game.types import ROLES, BySide, Role
from apollonius.io.interrupts import should_stop
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import (
    METRICS,
    CheckpointMeta,
    Evaluation,
    agent_file,
    end_checkpoint,
    load_checkpoint,
    load_checkpoint_meta,
    load_config,
    save_checkpoint,
)
from apollonius.learn.metrics import MetricsLine, append_metrics, begin_metrics, metrics_line
from apollonius.learn.progress import record_status
from apollonius.learn.stage import NO_NETWORKS, Metrics, Stage, TrainState
from apollonius.observe.registry import find_observation

CHECKPOINT_SECONDS = 60.0
"""Least time between two checkpoints."""


class CheckpointContent(eqx.Module):
    """Content of a checkpoint: the training state, the networks that later stages start from, and
    the best ones of this stage so far, where it keeps them.
    """

    train: TrainState
    networks: BySide[Network | None]
    best: dict[Role, Network] | None


@dataclass(eq=False)
class TrainingRun:
    """One training run, in a folder that `create_run` made. `execute` begins it or resumes it from
    its checkpoint.

    After every chunk `report` is called with its metrics and the share of the training that is
    done, and then `should_stop`: True saves a checkpoint and ends `execute` early.

    Attributes:
        progress: How far it is.
        is_resumed: True if a checkpoint is its beginning.
        networks: The networks that its stage started from.
        best: The best agents of its stage so far, where the stage keeps them.
    """

    config: RunConfig
    folder: Path
    report: Callable[[MetricsLine, float], None] = lambda line, share: None
    should_stop: Callable[[], bool] = should_stop
    progress: CheckpointMeta = field(init=False)
    is_resumed: bool = field(init=False, default=False)
    networks: BySide[Network | None] = field(init=False, default=NO_NETWORKS)
    best: dict[Role, Network] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.checkpoint = self.folder / "checkpoint.safetensors"
        self.metrics = self.folder / METRICS
        needs_chart = find_observation(self.config.algorithm.observation).needs_chart
        self.game = with_chart(self.config.game, needs_chart)

    def execute(self) -> bool:
        """Train to the end of the last stage; return False if stopped early. Raises InvalidInput
        for a checkpoint that this run cannot go on from, and while another process trains in the
        folder.
        """
        return record_status(self.folder, self._execute)

    def _execute(self) -> bool:
        self.read_progress()
        self.begin_metrics()
        if self.progress.ended:
            return True
        resumed = self.progress.stage if self.is_resumed else None
        for name in self.stages_left():
            stage = self.make_stage(name)
            train = self.load(stage) if name == resumed else self._begin(name, stage)
            train, is_finished = self._train_stage(stage, train)
            if not is_finished:
                return False
            self.end_stage(stage, stage.agents(train))
        end_checkpoint(self.checkpoint, self.config)
        return True

    def read_progress(self) -> None:
        """Read from the checkpoint how far the run is; one without begins, from the networks that
        its config names.
        """
        self.is_resumed = self.checkpoint.exists()
        if self.is_resumed:
            self.progress = load_checkpoint_meta(self.checkpoint, self.config)
        else:
            self.progress = CheckpointMeta(next(iter(self.config.by_name)))
            self.networks = ROLES.map(lambda role: load_first_network(self.config, role))

    def begin_metrics(self) -> None:
        """Make `metrics.jsonl`, or cut off what was written after the checkpoint."""
        begin_metrics(self.metrics, self.progress if self.is_resumed else None)

    def stages_left(self) -> list[str]:
        """Return the names of the stages that have not ended."""
        names = list(self.config.by_name)
        return names[names.index(self.progress.stage) :]

    def make_stage(self, name: str) -> Stage:
        """Make a stage by its name, with its opponents."""
        config = self.config
        return config.by_name[name].make(config.algorithm, self.game, self.folder)

    def stage_key(self, name: str) -> PRNGKeyArray:
        """Return the random key of a stage."""
        return jax.random.fold_in(jax.random.key(self.config.seed), self.config.stage_number(name))

    def _begin(self, name: str, stage: Stage) -> TrainState:
        train = stage.init(self.stage_key(name), self.networks)
        self.begin_stage(name, stage, stage.agents(train))
        return train

    def begin_stage(self, name: str, stage: Stage, agents: dict[Role, Network]) -> None:
        """Begin a stage, whose first agents are the best so far where it keeps these."""
        self.progress = CheckpointMeta(name, metrics_bytes=self.metrics.stat().st_size)
        # Copied: a chunk consumes the state that it is given.
        self.best = jax.tree.map(jnp.copy, agents) if stage.config.keeps_best else None

    def load(self, stage: Stage) -> TrainState:
        """Return the state of the checkpoint, which is in this stage."""
        name = self.progress.stage
        train = stage.init(self.stage_key(name), NO_NETWORKS)  # a state with other numbers
        agents = stage.agents(train)
        network = next(iter(agents.values()))
        has_network = self.config.sides_with_networks(name)
        networks = has_network.map(lambda has: network if has else None)
        best = agents if stage.config.keeps_best else None
        content = load_checkpoint(self.checkpoint, CheckpointContent(train, networks, best))
        self.networks, self.best = content.networks, content.best
        return content.train

    def save(self, train: TrainState) -> None:
        """Write the checkpoint."""
        content = CheckpointContent(train, self.networks, self.best)
        save_checkpoint(self.checkpoint, content, self.progress)

    def _train_stage(self, stage: Stage, train: TrainState) -> tuple[TrainState, bool]:
        """Train one stage from here. Returns its last state, and whether it ended by itself."""
        last_save = time.monotonic()
        while self.progress.chunks < stage.chunks:
            began = time.monotonic()
            train, metrics = stage.step(train)
            jax.block_until_ready(metrics)  # a chunk is handed out before it is computed
            line = self.record(stage, train, metrics, time.monotonic() - began)
            self.report(line, self.config.share(line.stage, line.env_steps))
            is_stopped, is_ended = self.should_stop(), self.progress.chunks == stage.chunks
            if is_stopped or is_ended or time.monotonic() - last_save >= CHECKPOINT_SECONDS:
                self.save(train)
                last_save = time.monotonic()
            if is_stopped and not is_ended:
                return train, False
        return train, True

    def record(
        self, stage: Stage, train: TrainState, metrics: Metrics, seconds: float
    ) -> MetricsLine:
        """Evaluate and save the agents where that is due after a chunk, and write its metrics.

        Args:
            stage: The stage.
            train: The state after the chunk, of which the counters are read, and the agents where
                they are due.
            metrics: The chunk's.
            seconds: Time that the chunk took.

        Returns:
            The line written.
        """
        began = time.monotonic()
        before = self.progress.chunks
        self.progress = replace(self.progress, chunks=before + 1)
        evaluation = self._evaluate(stage, train, before)
        if evaluation is not None and self._is_best(stage, evaluation):
            self.best = jax.tree.map(jnp.copy, stage.agents(train))
            self.progress = replace(self.progress, best=evaluation)
        self._save_snapshots(stage, train, before)
        speed = stage.algorithm.env_steps_per_chunk / seconds
        total = self.progress.seconds + seconds + time.monotonic() - began
        line = metrics_line(self.progress.stage, train, metrics, evaluation, total, speed)
        size = append_metrics(self.metrics, line)
        self.progress = replace(self.progress, seconds=total, metrics_bytes=size)
        return line

    def end_stage(self, stage: Stage, last_agents: dict[Role, Network]) -> None:
        """Save the best agents where the stage keeps them; later stages start from them, or else
        from the last ones.
        """
        if self.best is not None and self.progress.best is not None:
            for role, network in self.best.items():
                self._save_agent(stage, network, role, asdict(self.progress.best))
        agents: dict[Role, Any] = self.best or last_agents
        self.networks = ROLES.map(lambda role: agents.get(role, self.networks[role]))

    def _evaluate(self, stage: Stage, train: TrainState, before: int) -> Evaluation | None:
        """Evaluate the agents, where that is due."""
        if not stage.evaluates(before, self.progress.chunks):
            return None
        return Evaluation(int(train.env_steps), int(train.episodes), stage.evaluate(train))

    def _is_best(self, stage: Stage, evaluation: Evaluation) -> bool:
        best = self.progress.best.outcomes if self.progress.best else None
        return stage.config.keeps_best and stage.is_better(evaluation.outcomes, best)

    def _save_snapshots(self, stage: Stage, train: TrainState, before: int) -> None:
        """Save the agents where that is due; a stage that keeps its best ones saves these at its
        end.
        """
        times = stage.config.snapshots
        percents = [round(100 * number / times) for number in range(1, times + 1)]
        if stage.config.keeps_best:
            percents = percents[:-1]
        record = {"env_steps": int(train.env_steps), "episodes": int(train.episodes)}
        for percent in percents:
            if before < -(-stage.chunks * percent // 100) <= self.progress.chunks:
                for role, network in stage.agents(train).items():
                    self._save_agent(stage, network, role, record, percent)

    def _save_agent(
        self,
        stage: Stage,
        network: Network,
        role: Role,
        record: Mapping[str, object],
        percent: int = 100,
    ) -> None:
        name = self.progress.stage
        training = {
            "command": "apollonius train --config FILE, where FILE holds the config of this record",
            "seed": self.config.seed,
            "stage": name,
            **record,
            "config": to_dict(self.config),
        }
        agent = describe(
            network,
            role,
            to_dict(self.config.game),
            training,
            clearance_margin=stage.clearance_margin,
            loss_value=stage.loss_value,
        )
        save_agent(agent, agent_file(self.folder, self.config.agent_name(name, role), percent))


def train(folder: Path) -> bool:
    """Train the run of a folder, from its checkpoint if any; return False if stopped."""
    return TrainingRun(load_config(folder / "config.toml"), folder).execute()


def load_first_network(config: RunConfig, role: Role) -> Network | None:
    """Return the network that a side starts from, if the config names one; raises InvalidInput if
    it does not fit.
    """
    name = config.first_agents[role]
    if name is None:
        return None
    stages = [stage for stage in config.stages if role in stage.roles]
    unit = stages[0].loss_value(config.algorithm) if stages else None
    return config.algorithm.first_network(name, role, config.game, unit)


def require_agents(config: RunConfig) -> None:
    """Refuse, by InvalidInput, a run whose players or first networks cannot be loaded."""
    for stage in config.stages:
        stage.require_players(config.game)
    for role in Role:
        load_first_network(config, role)
