"""The state of a stage of training, and its first one (Algorithm 1, lines 1 to 3; Algorithm 2,
lines 1 to 4).
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.network import Layers, Network, QNetwork
from apollonius.agents.pool import LearnerAndPast, Pool, single_player
from apollonius.agents.trained import exploring_policy, greedy_policy
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import ROLES, BySide, Role
from apollonius.learn import archive, replay_buffer
from apollonius.learn.algorithm import Learner, ReplayConfig
from apollonius.learn.stage_config import Plan
from apollonius.observe.registry import find_observation
from apollonius.play.rollout import init_games


class PPOLearner(eqx.Module):
    """One side's network, whose values are logits, the critic of its observations, and the
    optimisers of both.

    `updates` counts the updates so far.
    """

    network: QNetwork
    critic: Layers
    optimisers: tuple[optax.OptState, ...]
    updates: Int[Array, ""]

    @property
    def average(self) -> QNetwork:
        """The network itself: a round changes it little."""
        return self.network


NO_NETWORKS: BySide[Network | None] = BySide(None, None)
"""Both sides start from random weights."""


class LearnerState(eqx.Module):
    """One learning side: its networks and its replay buffer."""

    learner: Learner
    buffer: replay_buffer.ReplayBuffer[Any]


class TrainState(eqx.Module):
    """Everything that changes while a stage is trained.

    `key` is folded with the number of iterations, never replaced. `env_steps` counts steps of
    single games. `archives` hold the earlier versions of both sides; None where the scheme has
    none. A side that learns alone has games in each setting.
    """

    games: Any
    learners: dict[Role, LearnerState]
    key: PRNGKeyArray
    iterations: Int[Array, ""]
    env_steps: Int[Array, ""]
    episodes: Int[Array, ""]
    archives: BySide[archive.Archive] | None = None


def start(
    plan: Plan,
    game: Game,
    key: PRNGKeyArray,
    fixed: Mapping[Role, Pool],
    networks: BySide[Network | None] = NO_NETWORKS,
) -> TrainState:
    """Return the state before the first step: empty replay buffers and first networks. The key is
    consumed.

    A `fixed` side does not learn; sides that do go on from their networks, or start from random
    weights.
    """
    config, learning = plan.learner, [role for role in Role if role not in fixed]
    assert isinstance(config, ReplayConfig)
    *network_keys, stage_key = jax.random.split(key, 1 + len(learning))

    def first(role: Role, key: PRNGKeyArray) -> LearnerState:
        columns, size = (
            config.games * len(game.bodies[role]),
            find_observation(config.observation).size,
        )
        buffer = replay_buffer.init_buffer(config.rows, columns, size, config.continuous)
        return LearnerState(config.init_learner(key, networks[role]), buffer)

    learners = {role: first(role, key) for role, key in zip(learning, network_keys, strict=True)}
    archives = None
    if plan.opponents.share > 0:
        archives = ROLES.map(
            lambda role: archive.init_archive(learners[role].learner.network, plan.opponents)
        )
    start_key, member_key, train_key = jax.random.split(stage_key, 3)
    iterations, env_steps, episodes = (jnp.zeros((), jnp.int32) for _ in range(3))
    state = TrainState(None, learners, train_key, iterations, env_steps, episodes, archives)
    bits = jax.random.bits(member_key, (2, config.games), jnp.uint32)
    first_games = init_games(
        game, reset_batch(game, start_key, config.games), players(plan, state, fixed), bits
    )
    # Apart: at the start what a side knows is the state itself.
    return replace(state, games=jax.tree.map(jnp.array, first_games))


def players(
    plan: Plan, state: TrainState, fixed: Mapping[Role, Pool]
) -> BySide[Pool | LearnerAndPast]:
    """Return the players of both sides: fixed ones, or a learner that explores, by soft
    actor-critic with noise that lasts, and in the slots its earlier versions.
    """
    config, past = plan.learner, plan.opponents
    assert isinstance(config, ReplayConfig)

    def of_side(role: Role) -> Pool | LearnerAndPast:
        if role in fixed:
            return fixed[role]
        stage = plan.stage
        amount = config.exploration(stage.epsilon[role], stage.env_steps, state.env_steps)
        noise_block = config.noise_block(state.iterations)
        bits = None
        if noise_block is not None:
            key = jax.random.fold_in(jax.random.fold_in(state.key, 4 + role), noise_block)
            bits = jax.random.bits(key, (config.games,), jnp.uint32)
        learner = exploring_policy(state.learners[role].learner.network, amount)
        if state.archives is None:
            return replace(single_player(learner), bits=bits)
        slots = past.slots, past.first_game(role, config.games), past.slot_games(config.games)
        return LearnerAndPast(learner, greedy_policy(state.archives[role].in_slots), *slots, bits)

    return ROLES.map(of_side)
