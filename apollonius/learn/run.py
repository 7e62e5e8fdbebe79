"""A training run in a folder: the stages in their order, metrics, agents, checkpoints, exact resume.

All that decides the final weights is in the config and the checkpoint. When checkpoints are written does not matter,
so they follow the clock: a run that is killed and resumed ends with the same bits as one that is not.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from functools import cached_property
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from apollonius.agents.network import Network
from apollonius.agents.pool import Pool, solo
from apollonius.agents.store import describe, save_agent
from apollonius.agents.trained import greedy
from apollonius.arenas.charting import charted
from apollonius.arenas.record import to_dict
from apollonius.catalogue import find_pool
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, sample_starts
from apollonius.game.outcome import counts_by_name
from apollonius.game.types import ROLES, Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.learn import curriculum
from apollonius.learn.checkpoint import Evaluation, Stand, load_checkpoint, load_stand, save_checkpoint
from apollonius.learn.config import RunConfig
from apollonius.learn.distillation import distillation, start_distillation
from apollonius.learn.folder import agent_file, held
from apollonius.learn.progress import Progress, append_metrics, begin_metrics, measure
from apollonius.learn.teacher import TABLES, Setting, make_settings
from apollonius.learn.train_state import DISTILLATION, FIXED_TARGET, SELF_PLAY, STAGES, Plan, TrainState, plans_of
from apollonius.observe.registry import find_observation
from apollonius.play.playout import play_out

CHECKPOINT_SECONDS = 60.0
"""Least time between two checkpoints."""
_EVALUATION_SEED = 20_200
"""Of the games of evaluations, the same for all runs; the judge uses others."""


class Saved(eqx.Module):
    """What a checkpoint holds: the training state and, in stage 1, the best pursuer so far by a fixed evaluation."""

    train: TrainState
    best: Network | None


class Run:
    """One training run. `execute` begins it or goes on from its checkpoint.

    Args:
        config: what to train.
        folder: where; `config.toml` must already lie there (`create_run`).
        report: called after every chunk.
        should_stop: asked after every chunk; True saves a checkpoint and ends `execute` early.
    """

    def __init__(
        self,
        config: RunConfig,
        folder: Path,
        report: Callable[[Progress], None] = lambda progress: None,
        should_stop: Callable[[], bool] = lambda: False,
    ) -> None:
        self.config = config
        self.folder = folder
        self.report = report
        self.should_stop = should_stop
        reads = find_observation(config.learner.observation)
        self.game = charted(config.game) if reads.charted else config.game
        self.checkpoint = folder / "checkpoint.safetensors"
        self.metrics = folder / "metrics.jsonl"
        self.evaders = find_pool(config.evaders, Role.EVADER, self.game)
        self.plans = plans_of(config)

    @cached_property
    def settings(self) -> list[Setting]:
        """The teachers of a distillation, and whom the student meets; games are solved for it that are not yet."""
        return make_settings(self.config, self.game, self.folder / TABLES)

    @property
    def work(self) -> dict[str, int]:
        """About how much each stage takes, by name: its env steps, once for each side that learns."""
        sides = {FIXED_TARGET: 1, SELF_PLAY: 2, DISTILLATION: 1}
        return {stage: sides[stage] * plan.stage.env_steps for stage, plan in self.plans.items()}

    def execute(self) -> bool:
        """Train to the end of the last stage. Returns False if stopped early.

        Raises:
            OSError: when the disk is full or read-only; the previous checkpoint is untouched.
            InvalidInput: when there is a checkpoint that this run cannot go on from, or when another process trains in
                the folder.
        """
        with held(self.folder):
            return self._execute()

    def _execute(self) -> bool:
        stand = load_stand(self.checkpoint) if self.checkpoint.exists() else None
        if stand is not None and stand.stage not in self.plans:
            raise InvalidInput(f"'{self.checkpoint}' is of another stage than its config.toml names: train again.")
        stages = list(self.plans)
        done = stages.index(stand.stage) if stand else 0
        best: Network | None = None
        for stage in stages[done:]:
            plan = self.plans[stage]
            if stand is None:
                begin_metrics(self.metrics)
            if stand is None or stand.stage != stage:
                first = ROLES.map(lambda role: curriculum.load_first(self.config, role))
                saved = self._start(stage, plan, BySide(first.pursuer or best, first.evader))
                stand = Stand(stage, metrics_bytes=self.metrics.stat().st_size)
            else:
                saved = load_checkpoint(self.checkpoint, self._start(stage, plan, BySide(None, None)))
                begin_metrics(self.metrics, stand)
            saved, finished = self._train_stage(plan, saved, stand)
            if not finished:
                return False
            best = saved.best
        return True

    def _start(self, stage: str, plan: Plan, networks: BySide[Network | None]) -> Saved:
        """What a stage begins with, whose networks go on from these."""
        game, key = self.game, jax.random.fold_in(jax.random.key(self.config.seed), STAGES.index(stage))
        if stage == DISTILLATION:
            return Saved(start_distillation(plan, self.settings, key, networks[self.config.distillation.side]), None)
        train = curriculum.start(plan, game, key, self._fixed(stage), networks)
        return Saved(train, _copy(train.learners[Role.PURSUER].learner.average) if stage == FIXED_TARGET else None)

    def _fixed(self, stage: str) -> dict[Role, Pool]:
        """Return the players of the side that does not learn in a stage of the curriculum."""
        return {Role.EVADER: self.evaders} if stage == FIXED_TARGET else {}

    def _train_stage(self, plan: Plan, saved: Saved, stand: Stand) -> tuple[Saved, bool]:
        """Train one stage from where it stands. Returns what it ends with, and whether it ended by itself."""
        train, best = saved.train, saved.best
        if stand.stage == DISTILLATION:
            chunks = distillation(plan, train, self.settings, stand.chunks)
        else:
            game = plan.stage.rewarded(self.game)
            chunks = curriculum.chunks(plan, game, train, self._fixed(stand.stage), stand.chunks)
        began, last_save = time.monotonic() - stand.seconds, time.monotonic()
        chunk_began = time.monotonic()
        for train, metrics in chunks:
            ended = int(train.env_steps) >= plan.stage.env_steps
            speed = plan.env_steps_per_chunk / (time.monotonic() - chunk_began)
            before, stand = stand.chunks, replace(stand, chunks=stand.chunks + 1)
            if _crosses(before, stand.chunks, plan.chunks, plan.stage.evaluations):
                best, stand = self._evaluate(plan, train, best, stand)
            self._keep_snapshots(plan, train, before, stand)
            stand = replace(stand, seconds=time.monotonic() - began)
            progress = measure(stand, plan, train, metrics, speed)
            stand = replace(stand, metrics_bytes=append_metrics(self.metrics, progress, metrics, stand.seconds))
            self.report(progress)
            stop = self.should_stop()
            if stop or ended or time.monotonic() - last_save >= CHECKPOINT_SECONDS:
                save_checkpoint(self.checkpoint, Saved(train, best), stand)
                last_save = time.monotonic()
            if stop and stand.chunks < plan.chunks:
                return Saved(train, best), False
            chunk_began = time.monotonic()
        if best is not None and stand.best is not None:
            self._save_agent(best, Role.PURSUER, _stage1_name(self.config.evaders), asdict(stand.best), stand)
        return Saved(train, best), True

    def _evaluate(
        self, plan: Plan, train: TrainState, best: Network | None, stand: Stand
    ) -> tuple[Network | None, Stand]:
        """Greedy play from fixed starts; in stage 1 it decides which pursuer is the best so far.

        Against an evader that stays that is the one with most captures (section IV), otherwise the latest: the one with
        most wins would be one that waits until a random evader has failed.
        """
        networks = {role: side.learner.average for role, side in train.learners.items()}
        taught = stand.stage == DISTILLATION
        fixed = solo(self.settings[0].opponents[0]) if taught else self.evaders
        game = self.settings[0].game if taught else self.game
        outcomes = _greedy_outcomes(game, networks, fixed, plan.stage.evaluation_games)
        found = Evaluation(int(train.env_steps), int(train.episodes), outcomes)
        stand = replace(stand, evaluation=found)
        if stand.stage != FIXED_TARGET:
            return None, stand
        moving = self.config.evaders != ("still",)
        if moving or stand.best is None or outcomes["captured"] > stand.best.outcomes["captured"]:
            return _copy(networks[Role.PURSUER]), replace(stand, best=found)
        return best, stand

    def _keep_snapshots(self, plan: Plan, train: TrainState, before: int, stand: Stand) -> None:
        record = {"env_steps": int(train.env_steps), "episodes": int(train.episodes)}
        if stand.stage == DISTILLATION and stand.chunks == plan.chunks:
            for role, side in train.learners.items():
                self._save_agent(side.learner.average, role, f"{role.name[0]}_optimal", record, stand)
        if stand.stage != SELF_PLAY:
            return
        kind = "curriculum" if FIXED_TARGET in self.plans or self.config.pursuer else "scratch"
        for percent in self.config.self_play.snapshot_percents:
            if before < -(-plan.chunks * percent // 100) <= stand.chunks:
                for role, side in train.learners.items():
                    name = f"{role.name[0]}_{kind}"
                    self._save_agent(side.learner.average, role, name, record, stand, percent)

    def _save_agent(
        self, network: Network, role: Role, name: str, record: Mapping[str, object], stand: Stand, percent: int = 100
    ) -> None:
        config = to_dict(self.config)
        command = "apollonius train --config FILE, where FILE holds the config of this record"
        training = {"command": command, "seed": self.config.seed, "stage": stand.stage, **record, "config": config}
        agent = describe(network, role, to_dict(self.config.game), training)
        save_agent(agent, agent_file(self.folder, name, percent))


def _greedy_outcomes(game: Game, networks: Mapping[Role, Network], fixed: Pool, games: int) -> dict[str, int]:
    """Return how many games ended how: networks play at their best, and a fixed player for a side without one."""
    start_key, play_key = jax.random.split(jax.random.key(_EVALUATION_SEED))
    players = ROLES.map(lambda role: solo(greedy(networks[role])) if role in networks else fixed)
    results = play_out(game, players, sample_starts(game, start_key, games), play_key)
    return counts_by_name(np.bincount(np.asarray(results.outcome), minlength=len(Outcome)))


def _stage1_name(evaders: tuple[str, ...]) -> str:
    """Name of the pursuer that learned to catch these evaders."""
    if evaders == ("still",):
        return "P_stage1"
    return f"P_{Path(evaders[0]).stem}" if len(evaders) == 1 else "P_pool"


def _copy(network: Network) -> Network:
    """The same weights in other memory: a chunk consumes the state it is given."""
    return jax.tree.map(jnp.copy, network)


def _crosses(before: int, after: int, total: int, times: int) -> bool:
    """Whether one of `times` evenly spaced moments in `total` chunks, the last at the end, is in (before, after]."""
    return after * times // total > before * times // total
