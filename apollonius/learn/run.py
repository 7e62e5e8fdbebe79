"""A training run in a folder: the stages in their order, metrics, agents, checkpoints, exact
resume.

All that decides the final weights is in the config and the checkpoint. When checkpoints are written
does not matter, so they follow the clock: a run that is killed and resumed ends with the same bits
as one that is not.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from apollonius.agents.network import Network, interpolate_weights
from apollonius.agents.pool import Pool, single_player
from apollonius.agents.store import describe, save_agent
from apollonius.agents.trained import greedy_policy, load_network
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import to_dict
from apollonius.catalogue import find_pool
from apollonius.game.game import sample_starts
from apollonius.game.outcome import counts_by_name
from apollonius.game.types import ROLES, BySide, Outcome, Role
from apollonius.io.interrupts import should_stop
from apollonius.learn import distillation, loop, ppo, train_state
from apollonius.learn.config import (
    DISTILLATION,
    FIXED_TARGET,
    RESPONSE,
    SELF_PLAY,
    STAGES,
    RunConfig,
)
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
from apollonius.learn.teacher import TABLES, distillation_tasks
from apollonius.learn.train_state import LearnerState, TrainState
from apollonius.learn.training_task import training_tasks
from apollonius.observe.registry import find_observation
from apollonius.play.playout import play_out

CHECKPOINT_SECONDS = 60.0
"""Least time between two checkpoints."""
_EVALUATION_SEED = 20_200
"""Seed of the games of evaluations, the same for all runs; the final evaluation uses others."""


class CheckpointContent(eqx.Module):
    """Content of a checkpoint: the training state and, in stage 1, the best pursuer so far by a
    fixed evaluation.
    """

    train: TrainState
    best: Network | None


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
        self.game = with_chart(
            self.config.game, find_observation(self.config.learner.observation).needs_chart
        )
        self.checkpoint = self.folder / "checkpoint.safetensors"
        self.metrics = self.folder / METRICS
        self.evaders = find_pool(self.config.evaders, Role.EVADER, self.game)
        self.game = with_chart(self.game, self.evaders.members.needs_chart)
        self.plans = self.config.plans
        self.fixed = {FIXED_TARGET: {Role.EVADER: self.evaders}}

    @cached_property
    def tasks(self) -> Sequence[Any]:
        """Games and opponents of a side that learns alone; in a distillation lessons, for which
        games are solved.
        """
        if self.config.stages == DISTILLATION:
            return distillation_tasks(self.config, self.game, self.folder / TABLES)
        return training_tasks(self.config.response, self.config.ppo, self.game)

    @property
    def clearance_margin(self) -> float:
        """Clearance after braking [m] that the agent keeps, or 0."""
        one_side = self.config.one_side
        return 0.0 if one_side is None else one_side.clearance_margin

    @property
    def loss_value(self) -> float | None:
        """Value of a lost game to a side that learns alone, in its network's units."""
        return None if self.config.one_side is None else float(self.tasks[0].loss_value)

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
        stages = list(self.plans)
        best: Network | None = None
        for stage in stages[stages.index(meta.stage) if meta else 0 :]:
            if meta is None:
                begin_metrics(self.metrics)
            if meta is None or meta.stage != stage:
                first = ROLES.map(lambda role: load_first_networks(self.config, role))
                saved = self.start(stage, BySide(first.pursuer or best, first.evader))
                meta = CheckpointMeta(stage, metrics_bytes=self.metrics.stat().st_size)
            else:
                saved = load_checkpoint(self.checkpoint, self.start(stage, BySide(None, None)))
                begin_metrics(self.metrics, meta)
            saved, finished = self._train_stage(saved, meta)
            if not finished:
                return False
            best = saved.best
        end_checkpoint(self.checkpoint, self.config)
        return True

    def start(self, stage: str, networks: BySide[Network | None]) -> CheckpointContent:
        """Return the beginning of a stage whose networks go on from these."""
        plan, key = (
            self.plans[stage],
            jax.random.fold_in(jax.random.key(self.config.seed), STAGES.index(stage)),
        )
        one_side = self.config.one_side
        if one_side is not None:
            begin = distillation.start_distillation if stage == DISTILLATION else ppo.start_response
            return CheckpointContent(begin(plan, self.tasks, key, networks[one_side.side]), None)
        train = train_state.start(
            plan, plan.stage.trained_in(self.game), key, self.fixed.get(stage, {}), networks
        )
        return CheckpointContent(train, _pursuer(train) if stage == FIXED_TARGET else None)

    def _train_stage(
        self, saved: CheckpointContent, meta: CheckpointMeta
    ) -> tuple[CheckpointContent, bool]:
        """Train one stage from here. Returns its last state, and whether it ended by itself."""
        train = saved.train
        best = saved.best
        stage = meta.stage
        plan = self.plans[stage]
        began = time.monotonic() - meta.seconds
        last_save = chunk_began = time.monotonic()
        chunks = self._chunks(stage, train, meta.chunks)
        for train, metrics in chunks:
            jax.block_until_ready(metrics)  # a chunk is handed out before it is computed
            speed = plan.env_steps_per_chunk / (time.monotonic() - chunk_began)
            before, meta = meta.chunks, replace(meta, chunks=meta.chunks + 1)
            evaluation = None
            if plan.evaluates(before, meta.chunks):
                evaluation = self._evaluate(stage, train)
                if self._is_best(evaluation, meta):
                    best = _pursuer(train)
                    meta = replace(meta, best=evaluation)
            self._save_agents(train, before, meta)
            seconds = time.monotonic() - began
            line = metrics_line(stage, train, metrics, evaluation, seconds, speed)
            meta = replace(meta, seconds=seconds, metrics_bytes=append_metrics(self.metrics, line))
            self.report(line, self.config.share(stage, line.env_steps))
            stop, ended = self.should_stop(), meta.chunks == plan.chunks
            if stop or ended or time.monotonic() - last_save >= CHECKPOINT_SECONDS:
                save_checkpoint(self.checkpoint, CheckpointContent(train, best), meta)
                last_save = time.monotonic()
            if stop and not ended:
                return CheckpointContent(train, best), False
            chunk_began = time.monotonic()
        if best is not None and meta.best is not None:
            self._save_agent(best, Role.PURSUER, self.config.stage1_name, asdict(meta.best), stage)
        return CheckpointContent(train, best), True

    def _chunks(
        self, stage: str, train: TrainState, done: int
    ) -> Iterator[tuple[TrainState, loop.Metrics]]:
        """Train a stage chunk by chunk, of which some are done."""
        plan = self.plans[stage]
        if stage == DISTILLATION:
            step = distillation.train_distillation_chunk
            return loop.train_round_robin(step, plan, train, self.tasks, done)
        if stage == RESPONSE:
            step = ppo.train_response_chunk
            return loop.train_round_robin(step, plan, train, self.tasks, done)
        game = plan.stage.trained_in(self.game)
        return loop.chunks(plan, game, train, self.fixed.get(stage, {}), done)

    def _evaluate(self, stage: str, train: TrainState) -> Evaluation:
        """Play greedily from fixed starts, with fixed players for a side that does not learn."""
        game, fixed = self.game, self.evaders
        if self.config.one_side is not None:
            game, fixed = self.tasks[0].game, single_player(self.tasks[0].opponents[0])

        def players(role: Role) -> Pool:
            if role not in train.learners:
                return fixed
            network = self._finish_stage(train.learners[role])
            return single_player(greedy_policy(network, self.clearance_margin, self.loss_value))

        start_key, play_key = jax.random.split(jax.random.key(_EVALUATION_SEED))
        starts = sample_starts(game, start_key, self.plans[stage].stage.evaluation_games)
        results = play_out(game, ROLES.map(players), starts, play_key)
        outcomes = counts_by_name(np.bincount(np.asarray(results.outcome), minlength=len(Outcome)))
        return Evaluation(int(train.env_steps), int(train.episodes), outcomes)

    def _is_best(self, evaluation: Evaluation, meta: CheckpointMeta) -> bool:
        """Check whether a pursuer of stage 1 is the best so far.

        Against an evader that stays that is the one with most captures (section IV), otherwise the
        latest: the one with most wins would be one that waits until a random evader has failed.
        """
        if meta.stage != FIXED_TARGET:
            return False
        if self.config.evaders != ("still",) or meta.best is None:
            return True
        return evaluation.outcomes["captured"] > meta.best.outcomes["captured"]

    def _save_agents(self, train: TrainState, before: int, meta: CheckpointMeta) -> None:
        """Save the agents at the snapshots of self-play, and that of a side that learns alone at
        its end.
        """
        plan, stage = self.plans[meta.stage], meta.stage
        times = {SELF_PLAY: self.config.self_play.snapshots, FIXED_TARGET: 0}.get(stage, 1)
        record: dict[str, object] = {
            "env_steps": int(train.env_steps),
            "episodes": int(train.episodes),
        }
        for percent in (round(100 * number / times) for number in range(1, times + 1)):
            if before < -(-plan.chunks * percent // 100) <= meta.chunks:
                for role, side in train.learners.items():
                    self._save_agent(
                        self._finish_stage(side),
                        role,
                        f"{role.name[0]}_{self.config.kind}",
                        record,
                        stage,
                        percent,
                    )

    def _finish_stage(self, side: LearnerState) -> Network:
        """Return the network of the agent: the averaged one, of a response mixed with its first."""
        network = side.learner.average
        initial_share = self.config.response.initial_weight_share
        if self.config.stages == RESPONSE and initial_share:
            first = load_first_networks(self.config, self.config.response.side)
            if first is not None:
                network = interpolate_weights(network, first, initial_share)
        return network

    def _save_agent(
        self,
        network: Network,
        role: Role,
        name: str,
        record: Mapping[str, object],
        stage: str,
        percent: int = 100,
    ) -> None:
        command = "apollonius train --config FILE, where FILE holds the config of this record"
        config = to_dict(self.config)
        training = {
            "command": command,
            "seed": self.config.seed,
            "stage": stage,
            **record,
            "config": config,
        }
        agent = describe(
            network,
            role,
            to_dict(self.config.game),
            training,
            clearance_margin=self.clearance_margin,
            loss_value=self.loss_value,
        )
        save_agent(agent, agent_file(self.folder, name, percent))


def train(folder: Path) -> bool:
    """Train the run of a folder, from its checkpoint if any; return False if stopped."""
    return TrainingRun(load_config(folder / "config.toml"), folder).execute()


def load_first_networks(config: RunConfig, role: Role) -> Network | None:
    """Return the network that a side starts from, if the config names one; raises InvalidInput if
    it does not fit.
    """
    name = BySide(config.pursuer, config.evader)[role]
    if name is None:
        return None
    network = config.learner.fit_network(load_network(name, role), role.name.lower(), name)
    if config.stages != RESPONSE:
        return network
    return ppo.first_network(network, config.ppo, name, role, config.game)


def _pursuer(train: TrainState) -> Network:
    """Return a copy of the pursuer's network: a chunk consumes the state it is given."""
    return jax.tree.map(jnp.copy, train.learners[Role.PURSUER].learner.average)
