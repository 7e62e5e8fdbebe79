"""Distillation: one side learns a teacher's action values, in the states of its own games (DAgger).

The student plays, greedy but for some random actions, against several opponents; among them some
that know it and search (`solve.players`). The teacher labels these states and others, and the
network is fitted to the labels (Ross, Gordon, Bagnell, "A reduction of imitation learning and
structured prediction to no-regret online learning", 2011; Rusu et al., "Policy distillation",
2016).
"""

import functools
from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from apollonius.agents.action_repeat import ActionRepeat
from apollonius.agents.network import Network, QNetwork
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import AbstractPlayers, PartitionedPlayers, single_player
from apollonius.agents.trained import exploring_policy, greedy_policy
from apollonius.game.types import NUM_ACTIONS, BySide, Scalar
from apollonius.learn.algorithm import interpolate_linearly
from apollonius.learn.dqn import DQNConfig, DQNLearner, adam_step
from apollonius.learn.loop import Metrics, after_iteration
from apollonius.learn.replay_buffer import ReplayBuffer, add
from apollonius.learn.stage_config import DistillationConfig, Plan
from apollonius.learn.states_to_label import starts_of, states_to_label
from apollonius.learn.teacher import DistillationTask
from apollonius.learn.train_state import LearnerState, TrainState
from apollonius.learn.training_task import equal_parts
from apollonius.observe.observation import observation_rows
from apollonius.play.rollout import Games, collect, init_games
from apollonius.solve.players import RolloutSearch

ORDER = 10.0
"""Weight of the differences between a state's actions, relative to their mean: the choice depends
on them alone.
"""
_PLANS = ((10, 1, NUM_ACTIONS), (10, 2, 3))
"""Plans of near-sighted and far-sighted attackers: steps of a hold, holds, and plans that are
followed further; one and two seconds, in a game with steps of 0.1 s.
"""


Labels = tuple[Float[Array, "rows size"], Float[Array, "rows 9"]]
"""Observations and the teacher's values of the nine actions there, NaN where there is nothing to
learn.
"""


def start_distillation(
    plan: Plan, tasks: Sequence[DistillationTask], key: PRNGKeyArray, network: Network | None = None
) -> TrainState:
    """Return the state before the first step, from random weights where there is no network. The
    key is consumed.
    """
    network_key, start_key, train_key = jax.random.split(key, 3)
    config = plan.learner
    assert isinstance(config, DQNConfig)
    learner = config.init_learner(network_key, network)
    keys = jax.random.split(start_key, len(tasks))
    first_games = [
        _first_games(plan, learner.network, *each) for each in zip(tasks, keys, strict=True)
    ]
    label_states = functools.partial(states_to_label, _config(plan))
    block = max(
        len(jax.eval_shape(label_states, *each, key)[2])
        for each in zip(tasks, first_games, strict=True)
    )
    rows = max(1, config.replay_capacity // block) * block
    size = learner.network.observation.size
    head, filled, iterations, env_steps, episodes = (jnp.zeros((), jnp.int32) for _ in range(5))
    buffer = ReplayBuffer((jnp.zeros((rows, size)), jnp.zeros((rows, NUM_ACTIONS))), head, filled)
    learners = {_config(plan).side: LearnerState(learner, buffer)}
    return TrainState(tuple(first_games), learners, train_key, iterations, env_steps, episodes)


@functools.partial(jax.jit, static_argnames="plan")
def _first_games(plan: Plan, network: QNetwork, task: DistillationTask, key: PRNGKeyArray) -> Games:
    bits = jnp.zeros((2, plan.learner.games), jnp.uint32)
    return init_games(
        task.game,
        starts_of(task, plan.learner.games, key),
        _players(plan, network, task, key),
        bits,
    )


@functools.partial(jax.jit, static_argnames="plan", donate_argnames="state")
def train_distillation_chunk(
    plan: Plan, state: TrainState, task: DistillationTask
) -> tuple[TrainState, Metrics]:
    """Train one chunk in one setting, whose games are played on."""
    after, metrics = jax.lax.scan(
        lambda state, _: _iterate(plan, state, task), state, None, plan.learner.iterations_per_chunk
    )
    return after, jax.tree.map(lambda leaf: jnp.sum(leaf, axis=0), metrics)


def _iterate(plan: Plan, state: TrainState, task: DistillationTask) -> tuple[TrainState, Metrics]:
    """Query the teacher, play some steps of every game, fit the student."""
    role = _config(plan).side
    game = task.game
    config = plan.learner
    side, key = state.learners[role], jax.random.fold_in(state.key, state.iterations)
    query_key, player_key, play_key, start_key, learn_key = jax.random.split(key, 5)
    assert isinstance(side.learner, DQNLearner)
    network = side.learner.network
    knowledge, states, learns = states_to_label(_config(plan), task, state.games, query_key)
    _, student_rows = observation_rows(network.observation, game, knowledge, role)
    values = task.values(states, role)
    buffer = add(side.buffer, (student_rows, jnp.where(learns[:, None], values, jnp.nan)))
    starts = jax.tree.map(lambda leaf: leaf[None], starts_of(task, config.games, start_key))
    players = _players(plan, network, task, player_key)
    games, played = collect(
        game, players, state.games, starts, play_key, config.steps_per_iteration
    )
    env_steps = state.env_steps + config.env_steps_per_iteration
    learner, loss = _fit(plan, side.learner, buffer, env_steps, learn_key)
    return after_iteration(
        state, games, played, env_steps, {role: (LearnerState(learner, buffer), loss)}
    )


def _players(
    plan: Plan, network: QNetwork, task: DistillationTask, key: PRNGKeyArray
) -> BySide[AbstractPlayers]:
    """Return the student, whose random actions last for a round, and its opponents, each in games
    of its own.
    """
    config = _config(plan)
    table = task.table
    games = plan.learner.games
    robots = len(task.game.bodies[config.side])
    explores = single_player(exploring_policy(network, jnp.float32(config.epsilon[config.side])))
    student = replace(explores, bits=jax.random.bits(key, (games * robots,), jnp.uint32))
    players: list[AbstractPolicy] = [*task.opponents]
    if table is not None:
        searches = (
            RolloutSearch(table.zero_sum_game, table.table, greedy_policy(network), *ahead)
            for ahead in _PLANS
        )
        players += [ActionRepeat(search, plan.learner.steps_per_iteration) for search in searches]
    left = games - config.near_sighted - config.far_sighted
    shares = [*equal_parts(left, len(task.opponents)), config.near_sighted, config.far_sighted]
    opponents = [pair for pair in zip(players, shares, strict=False) if pair[1]]
    return BySide.of(
        config.side, student, PartitionedPlayers(*map(tuple, zip(*opponents, strict=True)))
    )


def _fit(
    plan: Plan,
    learner: DQNLearner,
    buffer: ReplayBuffer[Labels],
    env_steps: Int[Array, ""],
    key: PRNGKeyArray,
) -> tuple[DQNLearner, Scalar]:
    """Make some updates from the labels; return their losses, added up."""
    config = plan.learner
    assert isinstance(config, DQNConfig)
    rate = interpolate_linearly(
        config.learning_rate, config.final_learning_rate, plan.stage.env_steps, env_steps
    )

    def update(learner: DQNLearner, key: PRNGKeyArray) -> tuple[DQNLearner, Scalar]:
        rows = jax.random.randint(key, (config.batch,), 0, buffer.filled)
        labels = jax.tree.map(lambda leaf: leaf[rows], buffer.rows)
        value, gradient = eqx.filter_value_and_grad(_error)(learner.network, labels)
        return adam_step(learner, gradient, rate, config.averaging), value

    learner, losses = jax.lax.scan(update, learner, jax.random.split(key, _config(plan).updates))
    return learner, jnp.sum(losses)


def _error(network: QNetwork, labels: Labels) -> Scalar:
    """Return the mean squared error of the differences between a state's actions, and of their
    mean.
    """
    observation, values = labels
    wrong = jnp.where(jnp.isnan(values), 0.0, network.batch(observation) - values)
    mean = jnp.mean(wrong, axis=1)
    return ORDER * jnp.mean(jnp.sum((wrong - mean[:, None]) ** 2, axis=1)) + jnp.mean(mean**2)


def _config(plan: Plan) -> DistillationConfig:
    assert isinstance(plan.stage, DistillationConfig)
    return plan.stage
