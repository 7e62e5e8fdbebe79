"""The state of a stage of training, and its first one (Algorithm 1, lines 1 to 3; Algorithm 2, lines 1 to 4)."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.pool import Assigned, Pool, solo
from apollonius.agents.trained import exploring, greedy
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import ROLES, Role, Scalar
from apollonius.learn import archive, dqn, replay_buffer, sac
from apollonius.learn.learner_config import DQNConfig, SACConfig
from apollonius.learn.stage_config import Plan
from apollonius.observe.registry import find_observation
from apollonius.play.rollout import begin

Learner = dqn.DQNLearner | sac.SACLearner
"""One side's networks and optimisers: `network` plays while it learns, `average` in evaluations."""
NO_NETWORKS: BySide[Network | None] = BySide(None, None)
"""Both sides start from random weights."""


class LearnerState(eqx.Module):
    """One learning side: its networks and its replay buffer."""

    learner: Learner
    buffer: replay_buffer.ReplayBuffer[Any]


class TrainState(eqx.Module):
    """Everything that changes while a stage is trained.

    `key` is folded with the number of iterations, never replaced. `env_steps` counts steps of single games. `archives`
    hold the earlier versions of both sides; None where the scheme has none. A distillation has games in each setting.
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
    """Return the state before the first step: empty replay buffers and first networks. The key is consumed.

    A `fixed` side does not learn; sides that do go on from their networks, or start from random weights.
    """
    config, learning = plan.learner, [role for role in Role if role not in fixed]
    *network_keys, stage_key = jax.random.split(key, 1 + len(learning))

    def first(role: Role, key: PRNGKeyArray) -> LearnerState:
        columns, size = config.games * len(game.bodies[role]), find_observation(config.observation).size
        continuous, of_teams = isinstance(config, SACConfig), game.teams is not None
        buffer = replay_buffer.init(config.rows, columns, size, continuous, of_teams)
        return LearnerState(first_learner(plan, key, networks[role]), buffer)

    learners = {role: first(role, key) for role, key in zip(learning, network_keys, strict=True)}
    archives = None
    if plan.opponents.share > 0:
        archives = ROLES.map(lambda role: archive.init(learners[role].learner.network, plan.opponents))
    start_key, member_key, train_key = jax.random.split(stage_key, 3)
    playing = ROLES.map(lambda role: players(plan, role, learners, fixed, archives, jnp.ones(())))
    bits = jax.random.bits(member_key, (2, config.games), jnp.uint32)
    begun = begin(game, reset_batch(game, start_key, config.games), playing, bits)
    games = jax.tree.map(jnp.array, begun)  # apart: at the start what a side knows is the state itself
    iterations, env_steps, episodes = (jnp.zeros((), jnp.int32) for _ in range(3))
    return TrainState(games, learners, train_key, iterations, env_steps, episodes, archives)


def first_learner(plan: Plan, key: PRNGKeyArray, network: Network | None) -> Learner:
    """Return a learner that starts from a copy of a network, or from random weights. The key is consumed."""
    if isinstance(plan.learner, SACConfig):
        return sac.init(plan.learner, key, network)
    assert isinstance(plan.learner, DQNConfig)
    return dqn.init(plan.learner, key, network)


def players(
    plan: Plan,
    role: Role,
    learners: Mapping[Role, LearnerState],
    fixed: Mapping[Role, Pool],
    archives: BySide[archive.Archive] | None,
    amount: Scalar,
) -> Pool | Assigned:
    """Return the players of one side: the fixed ones, or its learner and, in the slots, its earlier versions."""
    if role in fixed:
        return fixed[role]
    learner = exploring(learners[role].learner.network, amount)
    if archives is None:
        return solo(learner)
    config, games = plan.opponents, plan.learner.games
    slots = config.slots, config.first_game(role, games), config.slot_games(games)
    return Assigned(learner, greedy(archives[role].in_slots), *slots)
