"""What a stage of training is and what changes in it: the plan, the learning sides, the games under way."""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.pool import Pool, Seated, solo
from apollonius.agents.trained import exploring
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import Role, Scalar
from apollonius.learn import opponents, replay
from apollonius.learn.algorithm import Learner, algorithm_of
from apollonius.learn.config import SelfPlayConfig, StageConfig
from apollonius.learn.learner_config import LearnerConfig
from apollonius.learn.payoffs import Payoffs, nothing_played
from apollonius.learn.scheme import OpponentConfig
from apollonius.observe.registry import find_observation
from apollonius.rollout import Games, begin

DEVICES = "devices"
"""Name of the axis of devices that share a training."""
_CHUNK_ENV_STEPS = 8192
"""Env steps of all devices between two looks from outside (progress, checkpoints, Ctrl-C), where iterations are small
enough."""


@dataclass(frozen=True)
class Plan:
    """The fixed part of a stage: how to learn and for how long. Hashable, so it is static under `jit`."""

    learner: LearnerConfig
    stage: StageConfig
    devices: int = 1
    """How many devices share the stage; the numbers above are then the share of each (`apollonius.learn.devices`)."""

    @property
    def across(self) -> str | None:
        """The axis over which devices agree, if there are several."""
        return DEVICES if self.devices > 1 else None

    @property
    def opponents(self) -> OpponentConfig:
        """Whom both sides meet where both learn."""
        return self.stage.opponents if isinstance(self.stage, SelfPlayConfig) else OpponentConfig()

    @property
    def iterations_per_chunk(self) -> int:
        """Rounds of play and updates in one compiled call."""
        return max(8, _CHUNK_ENV_STEPS // self.devices // self.learner.env_steps_per_iteration)

    @property
    def env_steps_per_chunk(self) -> int:
        """Env steps in one compiled call."""
        return self.iterations_per_chunk * self.learner.env_steps_per_iteration

    @property
    def chunks_per_sitting(self) -> int:
        """Compiled calls between two changes of opponents."""
        return -(-self.opponents.renewal // self.env_steps_per_chunk)

    @property
    def sitting(self) -> int:
        """Steps of every game between two changes of opponents."""
        return self.chunks_per_sitting * self.env_steps_per_chunk // self.learner.games

    def renews_after(self, chunks: int) -> bool:
        """Whether opponents change after so many chunks of a stage."""
        return self.opponents.share > 0 and chunks > 0 and chunks % self.chunks_per_sitting == 0

    @property
    def chunks(self) -> int:
        """Compiled calls in the whole stage."""
        return -(-self.stage.env_steps // self.env_steps_per_chunk)


class Learning(eqx.Module):
    """One learning side: its networks, its memory and, where a scheme wants them, its earlier versions and a second
    learner, the exploiter, which learns from the same memory how to beat the other side's learner.
    """

    learner: Learner
    replay: replay.Replay
    archive: opponents.Archive | None = None
    exploiter: Learner | None = None


class TrainState(eqx.Module):
    """Everything that changes while a stage is trained; a side that does not learn is None.

    `key` is folded with the number of iterations, never replaced. `env_steps` counts steps of single games. `payoffs`
    is how the versions of both sides fare against each other, where a scheme asks for it.
    """

    games: Games
    pursuer: Learning | None
    evader: Learning | None
    key: PRNGKeyArray
    iterations: Int[Array, ""]
    env_steps: Int[Array, ""]
    episodes: Int[Array, ""]
    payoffs: Payoffs | None = None


def start(
    plan: Plan,
    game: Game,
    key: PRNGKeyArray,
    pursuer: Learner | Pool,
    evader: Learner | Pool,
) -> TrainState:
    """The state before the first step. A side given as a `Learner` learns; one given as a `Pool` does not.

    The key is consumed.
    """
    start_key, member_key, train_key = jax.random.split(key, 3)
    games = plan.learner.games
    words = jax.random.bits(member_key, (2, games), jnp.uint32)
    chaser, pursuers = _side(plan, Role.PURSUER, pursuer)
    runner, evaders = _side(plan, Role.EVADER, evader)
    return TrainState(
        games=begin(reset_batch(game, start_key, games), BySide(pursuers, evaders), words, plan.stage.disturbance),
        pursuer=chaser,
        evader=runner,
        key=train_key,
        iterations=jnp.zeros((), jnp.int32),
        env_steps=jnp.zeros((), jnp.int32),
        episodes=jnp.zeros((), jnp.int32),
        payoffs=nothing_played(plan.opponents.versions) if plan.opponents.keeps_payoffs else None,
    )


def first_learner(plan: Plan, key: PRNGKeyArray, network: Network | None = None) -> Learner:
    """A learner that goes on from a network, or from scratch. The key is consumed."""
    algorithm = algorithm_of(plan.learner)
    if network is None:
        return algorithm.init(plan.learner, key)
    return algorithm.start_from(plan.learner, network, key)


def _side(plan: Plan, role: Role, side: Learner | Pool) -> tuple[Learning | None, Pool | Seated]:
    """What one side begins with, and who plays it."""
    if isinstance(side, Pool):
        return None, side
    algorithm = algorithm_of(plan.learner)
    size = find_observation(plan.learner.observation).size
    archive = opponents.init(side.network, plan.opponents) if plan.opponents.share else None
    exploiter = algorithm.branch(side) if plan.opponents.has_exploiters else None
    memory = replay.init(plan.learner.rows, plan.learner.games, size, algorithm.action)
    learning = Learning(side, memory, archive, exploiter)
    return learning, players(plan, role, learning, None, jnp.ones(()))


def players(plan: Plan, role: Role, side: Learning | None, pool: Pool | None, amount: Scalar) -> Pool | Seated:
    """Who plays one side: a given pool, or its learner, exploring by some amount (`agents.trained.exploring`), and, in
    the seats, its earlier versions.
    """
    if pool is not None:
        return pool
    assert side is not None, "a side without players must learn"
    if side.archive is None:
        return solo(exploring(side.learner.network, amount))
    exploiter = side.exploiter.network if side.exploiter else None
    learner = side.learner.network
    return opponents.seat(side.archive, plan.opponents, role, learner, amount, plan.learner.games, exploiter)
