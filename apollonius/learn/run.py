"""A training run in a folder: the stages in their order, metrics, agents, checkpoints, exact
resume.

All that decides the final weights is in the config and the checkpoint. When checkpoints are written
does not matter, so they follow the clock: a run that is killed and resumed ends with the same bits
as one that is not.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

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
from apollonius.learn.stage import NO_NETWORKS, Stage, TrainState
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
    """

    config: RunConfig
    folder: Path
    report: Callable[[MetricsLine, float], None] = lambda line, share: None
    should_stop: Callable[[], bool] = should_stop

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
        meta = (
            load_checkpoint_meta(self.checkpoint, self.config) if self.checkpoint.exists() else None
        )
        if meta is not None and meta.ended:
            begin_metrics(self.metrics, meta)
            return True
        names = list(self.config.by_name)
        networks = NO_NETWORKS
        if meta is None:
            begin_metrics(self.metrics)
            networks = ROLES.map(lambda role: load_first_network(self.config, role))
        for name in names[names.index(meta.stage) if meta else 0 :]:
            stage = self.make_stage(name)
            if meta is None or meta.stage != name:
                content = self.begin(name, stage, networks)
                meta = CheckpointMeta(name, metrics_bytes=self.metrics.stat().st_size)
            else:
                content = load_checkpoint(self.checkpoint, self._template(name, stage))
                begin_metrics(self.metrics, meta)
            content, is_finished = self._train_stage(stage, content, meta)
            if not is_finished:
                return False
            networks = _networks_after(stage, content)
        end_checkpoint(self.checkpoint, self.config)
        return True

    def make_stage(self, name: str) -> Stage:
        """Make a stage by its name, with its opponents."""
        config = self.config
        return config.by_name[name].make(config.algorithm, self.game, self.folder)

    def begin(self, name: str, stage: Stage, networks: BySide[Network | None]) -> CheckpointContent:
        """Return the beginning of a stage that starts from these networks."""
        seed_key = jax.random.key(self.config.seed)
        key = jax.random.fold_in(seed_key, self.config.stage_number(name))
        train = stage.init(key, networks)
        best = jax.tree.map(jnp.copy, stage.agents(train)) if stage.config.keeps_best else None
        return CheckpointContent(train, networks, best)

    def _template(self, name: str, stage: Stage) -> CheckpointContent:
        """Return the content of a checkpoint in this stage, with other numbers."""
        content = self.begin(name, stage, NO_NETWORKS)
        network = next(iter(stage.agents(content.train).values()))
        has_network = self.config.sides_with_networks(name)
        networks = has_network.map(lambda has: network if has else None)
        return replace(content, networks=networks)

    def _train_stage(
        self, stage: Stage, content: CheckpointContent, meta: CheckpointMeta
    ) -> tuple[CheckpointContent, bool]:
        """Train one stage from here. Returns its last content, and whether it ended by itself."""
        began = time.monotonic() - meta.seconds
        last_save = time.monotonic()
        env_steps = stage.algorithm.env_steps_per_chunk
        while meta.chunks < stage.chunks:
            chunk_began = time.monotonic()
            train, metrics = stage.step(content.train)
            jax.block_until_ready(metrics)  # a chunk is handed out before it is computed
            speed = env_steps / (time.monotonic() - chunk_began)
            content = replace(content, train=train)
            before, meta = meta.chunks, replace(meta, chunks=meta.chunks + 1)
            evaluation = self._evaluate(stage, train, before, meta)
            if evaluation is not None and _is_best(stage, evaluation, meta):
                # Copied: a chunk consumes the state that it is given.
                content = replace(content, best=jax.tree.map(jnp.copy, stage.agents(train)))
                meta = replace(meta, best=evaluation)
            self._save_snapshots(stage, train, before, meta)
            seconds = time.monotonic() - began
            line = metrics_line(meta.stage, train, metrics, evaluation, seconds, speed)
            meta = replace(meta, seconds=seconds, metrics_bytes=append_metrics(self.metrics, line))
            self.report(line, self.config.share(meta.stage, line.env_steps))
            is_stopped, is_ended = self.should_stop(), meta.chunks == stage.chunks
            if is_stopped or is_ended or time.monotonic() - last_save >= CHECKPOINT_SECONDS:
                save_checkpoint(self.checkpoint, content, meta)
                last_save = time.monotonic()
            if is_stopped and not is_ended:
                return content, False
        if content.best is not None and meta.best is not None:
            for role, network in content.best.items():
                self._save_agent(stage, network, role, asdict(meta.best), meta.stage)
        return content, True

    def _evaluate(
        self, stage: Stage, train: TrainState, before: int, meta: CheckpointMeta
    ) -> Evaluation | None:
        """Evaluate the agents, where that is due."""
        if not stage.evaluates(before, meta.chunks):
            return None
        return Evaluation(int(train.env_steps), int(train.episodes), stage.evaluate(train))

    def _save_snapshots(
        self, stage: Stage, train: TrainState, before: int, meta: CheckpointMeta
    ) -> None:
        """Save the agents where that is due; a stage that keeps its best ones saves these at its
        end.
        """
        times = stage.config.snapshots
        percents = [round(100 * number / times) for number in range(1, times + 1)]
        record = {"env_steps": int(train.env_steps), "episodes": int(train.episodes)}
        for percent in percents[: times - stage.config.keeps_best]:
            if before < -(-stage.chunks * percent // 100) <= meta.chunks:
                for role, network in stage.agents(train).items():
                    self._save_agent(stage, network, role, record, meta.stage, percent)

    def _save_agent(
        self,
        stage: Stage,
        network: Network,
        role: Role,
        record: Mapping[str, object],
        name: str,
        percent: int = 100,
    ) -> None:
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


def _is_best(stage: Stage, evaluation: Evaluation, meta: CheckpointMeta) -> bool:
    best = meta.best.outcomes if meta.best else None
    return stage.config.keeps_best and stage.is_better(evaluation.outcomes, best)


def _networks_after(stage: Stage, content: CheckpointContent) -> BySide[Network | None]:
    """Return the networks that later stages start from: the best ones of this stage, or its last
    ones.
    """
    agents: dict[Role, Any] = content.best or stage.agents(content.train)
    return ROLES.map(lambda role: agents.get(role, content.networks[role]))


def train(folder: Path) -> bool:
    """Train the run of a folder, from its checkpoint if any; return False if stopped."""
    return TrainingRun(load_config(folder / "config.toml"), folder).execute()


def load_first_network(config: RunConfig, role: Role) -> Network | None:
    """Return the network that a side starts from, if the config names one; raises InvalidInput if
    it does not fit.
    """
    name = config.first_agents[role]
    return None if name is None else config.algorithm.first_network(name, role, config.game)


def require_agents(config: RunConfig) -> None:
    """Refuse, by InvalidInput, a run whose players or first networks cannot be loaded."""
    for stage in config.stages:
        stage.require_players(config.game)
    for role in Role:
        load_first_network(config, role)
