"""A training run in a folder: the stages in their order, metrics, agents, checkpoints, exact resume.

All that decides the final weights is in the config and the checkpoint. When checkpoints are written does not matter,
so they follow the clock: a run that is killed and resumed ends with the same bits as one that is not.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from apollonius.agents.network import Network
from apollonius.agents.pool import solo
from apollonius.agents.store import describe, save_agent
from apollonius.agents.trained import at_best, load_network
from apollonius.arenas.record import to_dict
from apollonius.catalogue import find_pool
from apollonius.errors import InvalidInput
from apollonius.game.by_side import BySide
from apollonius.game.outcome import counts_by_name
from apollonius.game.types import Outcome, Role
from apollonius.learn.algorithm import require_fitting
from apollonius.learn.checkpoint import load_checkpoint, load_progress, save_checkpoint
from apollonius.learn.config import RunConfig
from apollonius.learn.fixed_target import start_fixed_target
from apollonius.learn.folder import agent_file
from apollonius.learn.progress import Progress, append_metrics, measure, truncate_metrics
from apollonius.learn.renewal import renew_opponents
from apollonius.learn.self_play import start_self_play
from apollonius.learn.stage import play_and_learn
from apollonius.learn.state import Plan, TrainState
from apollonius.playout import draw_starts, play_out

FIXED_TARGET, SELF_PLAY = "fixed-target", "self-play"
CHECKPOINT_SECONDS = 60.0
"""Least time between two checkpoints."""
_EVALUATION_SEED = 20_200
"""Seed of the evaluation games inside training, the same for all runs; the judge uses others."""


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
        self.checkpoint = folder / "checkpoint.safetensors"
        self.metrics = folder / "metrics.jsonl"
        self.evaders = find_pool(config.evaders, Role.EVADER, config.game)
        self.stages = [FIXED_TARGET, SELF_PLAY] if config.stages == "both" else [config.stages]

    @property
    def work(self) -> dict[str, int]:
        """About how much each stage takes, by name: its env steps, once for each side that learns."""
        return {stage: self._plan(stage).stage.env_steps * (1 if stage == FIXED_TARGET else 2) for stage in self.stages}

    def execute(self) -> bool:
        """Train to the end of the last stage. Returns False if stopped early.

        Raises:
            OSError: when the disk is full or read-only; the previous checkpoint is untouched.
            InvalidInput: when there is a checkpoint that this run cannot go on from.
        """
        progress = load_progress(self.checkpoint) if self.checkpoint.exists() else None
        if progress is None:
            truncate_metrics(self.metrics, 0)
        elif progress["stage"] not in self.stages:
            raise InvalidInput(f"'{self.checkpoint}' is of another stage than its config.toml names: train again.")
        done = self.stages.index(progress["stage"]) if progress else 0
        best: Network | None = None
        for stage in self.stages[done:]:
            plan = self._plan(stage)
            here = progress if progress and progress["stage"] == stage else None
            evader: Network | None = None
            if not here:
                best = load_first(self.config, Role.PURSUER) or best
                evader = load_first(self.config, Role.EVADER)
            train = self._start(stage, plan, best, evader)
            saved = Saved(train, _copy(_pursuer(train)) if stage == FIXED_TARGET else None)
            if here:
                saved = load_checkpoint(self.checkpoint, saved)
            else:
                here = {"stage": stage, "chunks": 0, "seconds": 0.0, "best": None, "evaluation": None}
                here["metrics_bytes"] = self.metrics.stat().st_size
            saved, finished = self._train_stage(stage, plan, saved, here)
            if not finished:
                return False
            best = saved.best
        return True

    def _plan(self, stage: str) -> Plan:
        return Plan(self.config.learner, self.config.fixed_target if stage == FIXED_TARGET else self.config.self_play)

    def _start(self, stage: str, plan: Plan, best: Network | None, evader: Network | None) -> TrainState:
        key = jax.random.fold_in(jax.random.key(self.config.seed), [FIXED_TARGET, SELF_PLAY].index(stage))
        if stage == FIXED_TARGET:
            return start_fixed_target(plan, self.config.game, key, self.evaders, best)
        return start_self_play(plan, self.config.game, key, best, evader)

    def _train_stage(self, stage: str, plan: Plan, saved: Saved, here: dict[str, Any]) -> tuple[Saved, bool]:
        """Train one stage from where it stands. Returns what it ends with, and whether it ended by itself."""
        pursuer, evader = None, self.evaders if stage == FIXED_TARGET else None
        train, best = saved.train, saved.best
        game = plan.stage.rewarded(self.config.game)
        truncate_metrics(self.metrics, here["metrics_bytes"])
        began, last_save = time.monotonic() - here["seconds"], time.monotonic()
        while here["chunks"] < plan.chunks:
            chunk_began = time.monotonic()
            if plan.renews_after(here["chunks"]):
                train = renew_opponents(plan, game, train)
            train, metrics = play_and_learn(plan, game, train, pursuer, evader)
            env_steps = int(train.env_steps)
            speed = plan.env_steps_per_chunk / (time.monotonic() - chunk_began)
            before, here["chunks"] = here["chunks"], here["chunks"] + 1
            if _crosses(before, here["chunks"], plan.chunks, plan.stage.evaluations):
                best = self._evaluate(stage, plan, train, best, here)
            self._keep_snapshots(stage, plan, train, before, here)
            here["seconds"] = time.monotonic() - began
            progress = measure(stage, plan, train, metrics, speed, here["evaluation"])
            here["metrics_bytes"] = append_metrics(self.metrics, progress, metrics, here["seconds"])
            self.report(progress)
            stop = self.should_stop()
            if stop or env_steps >= plan.stage.env_steps or time.monotonic() - last_save >= CHECKPOINT_SECONDS:
                save_checkpoint(self.checkpoint, Saved(train, best), here)
                last_save = time.monotonic()
            if stop and here["chunks"] < plan.chunks:
                return Saved(train, best), False
        if best is not None:
            self._save_agent(best, Role.PURSUER, _stage1_name(self.config.evaders), here["best"], stage)
        return Saved(train, best), True

    def _evaluate(
        self, stage: str, plan: Plan, train: TrainState, best: Network | None, here: dict[str, Any]
    ) -> Network | None:
        """Greedy play from fixed starts; in stage 1 it decides which pursuer is the best so far.

        Against an evader that stays that is the one with most captures (section IV), otherwise the latest: the one with
        most wins would be one that waits until a random evader has failed.
        """
        games = plan.stage.evaluation_games
        start_key, play_key = jax.random.split(jax.random.key(_EVALUATION_SEED))
        starts = draw_starts(self.config.game, start_key, games)
        evader = self.evaders if train.evader is None else solo(at_best(train.evader.learner.average))
        results = play_out(self.config.game, BySide(solo(at_best(_pursuer(train))), evader), starts, play_key)
        outcomes = counts_by_name(np.bincount(np.asarray(results.outcome), minlength=len(Outcome)))
        here["evaluation"] = {"env_steps": int(train.env_steps), "episodes": int(train.episodes), "outcomes": outcomes}
        if stage != FIXED_TARGET:
            return None
        moving = self.config.evaders != ("still",)
        if moving or here["best"] is None or outcomes["captured"] > here["best"]["outcomes"]["captured"]:
            here["best"] = here["evaluation"]
            return _copy(_pursuer(train))
        return best

    def _keep_snapshots(self, stage: str, plan: Plan, train: TrainState, before: int, here: dict[str, Any]) -> None:
        if stage != SELF_PLAY or train.evader is None:
            return
        kind = "curriculum" if FIXED_TARGET in self.stages or self.config.pursuer else "scratch"
        for percent in self.config.self_play.snapshot_percents:
            if before < -(-plan.chunks * percent // 100) <= here["chunks"]:
                record = {"env_steps": int(train.env_steps), "episodes": int(train.episodes)}
                self._save_agent(_pursuer(train), Role.PURSUER, f"P_{kind}", record, stage, percent)
                self._save_agent(train.evader.learner.average, Role.EVADER, f"E_{kind}", record, stage, percent)

    def _save_agent(
        self, network: Network, role: Role, name: str, record: dict[str, Any], stage: str, percent: int = 100
    ) -> None:
        config = to_dict(self.config)
        command = "apollonius train --config FILE, where FILE holds the config of this record"
        training = {"command": command, "seed": self.config.seed, "stage": stage, **record, "config": config}
        agent = describe(network, role, to_dict(self.config.game), training)
        save_agent(agent, agent_file(self.folder, name, percent))


def load_first(config: RunConfig, role: Role) -> Network | None:
    """The network that a side goes on from, if the config names one.

    Raises:
        InvalidInput: when there is no such agent, or its network is not of the kind that the config trains.
    """
    name = config.pursuer if role == Role.PURSUER else config.evader
    if name is None:
        return None
    network = load_network(name, role)
    require_fitting(network, config.learner, role.name.lower(), name)
    return network


def _stage1_name(evaders: tuple[str, ...]) -> str:
    """Name of the pursuer that learned to catch these evaders."""
    if evaders == ("still",):
        return "P_stage1"
    return f"P_{Path(evaders[0]).stem}" if len(evaders) == 1 else "P_pool"


def _pursuer(train: TrainState) -> Network:
    assert train.pursuer is not None, "every stage trains a pursuer"
    return train.pursuer.learner.average


def _copy(network: Network) -> Network:
    """The same weights in other memory: a chunk consumes the state it is given."""
    return jax.tree.map(jnp.copy, network)


def _crosses(before: int, after: int, total: int, times: int) -> bool:
    """Whether one of `times` evenly spaced moments in `total` chunks, the last at the end, is in (before, after]."""
    return after * times // total > before * times // total
