"""A best response by proximal policy optimisation (Schulman et al., 2017): one side against others
that do not learn.

The network's values of the nine actions, taken as logits, are a policy that draws its actions;
where it counts, the best one is played. In an update no action becomes much more or less likely
than in the games that it is learned from.
"""

import functools
from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from apollonius.agents.network import (
    Layers,
    Network,
    QNetwork,
    apply_to_batch,
    make_layers,
    make_network,
    scale_outputs,
)
from apollonius.agents.pool import AbstractPlayers, PartitionedPlayers, single_player
from apollonius.catalogue import find_player, loss_value
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import BySide, Role, Scalar
from apollonius.learn.algorithm import interpolate_linearly
from apollonius.learn.clearance_penalty import without_clearance_penalty
from apollonius.learn.loop import Metrics, after_iteration, row_of
from apollonius.learn.ppo_config import PPOConfig
from apollonius.learn.replay_buffer import ReplayBuffer, Row, add
from apollonius.learn.restarts import RestartBuffer, add_losses, empty_restarts, mix_in_restarts
from apollonius.learn.sampling_policy import SamplingPolicy
from apollonius.learn.stage_config import Plan, ResponseConfig
from apollonius.learn.train_state import LearnerState, PPOLearner, TrainState
from apollonius.learn.training_task import TrainingTask, equal_parts
from apollonius.play.rollout import collect, init_games

_HIDDEN = 256, 256
"""Units of the critic's hidden layers."""
_STARTS = 8
"""Starts of each column of games in a round; shorter games begin from some again."""
_ROUNDS_SEEN = 16
"""Rounds of which some observations are kept, to find the units that a network has little use for
in all its games.
"""
_adam = tuple(
    optax.chain(optax.clip_by_global_norm(most), optax.scale_by_adam()) for most in (0.5, 1.0)
)


def first_network(
    network: Network, learner: PPOConfig, name: str, role: Role, game: Game
) -> Network:
    """Return an agent's network as the first one of a response: without caution, its values as
    logits.
    """
    price = loss_value(find_player(name, role, game), game)
    return scale_outputs(without_clearance_penalty(network), learner.loss_value / price)


def start_response(
    plan: Plan, tasks: Sequence[TrainingTask], key: PRNGKeyArray, network: Network | None = None
) -> TrainState:
    """Return the state before the first step, from random weights where there is no network, whose
    values are logits. The key is consumed.
    """
    (config, stage), (network_key, critic_key, start_key, train_key) = (
        _configs(plan),
        jax.random.split(key, 4),
    )
    first = network or make_network(
        config.observation, config.width, config.depth, network_key, config.symmetric
    )
    assert isinstance(first, QNetwork)
    own, size = jax.tree.map(jnp.copy, first), first.observation.size
    critic = make_layers([size, *_HIDDEN, 1], critic_key)
    optimisers = tuple(
        adam.init(eqx.filter(part, eqx.is_array))
        for adam, part in zip(_adam, (own, critic), strict=True)
    )
    head, filled, iterations, env_steps, episodes, updates = (
        jnp.zeros((), jnp.int32) for _ in range(6)
    )
    observations = ReplayBuffer(
        (jnp.zeros((_ROUNDS_SEEN * _num_observations(config), size)),), head, filled
    )
    learners = {
        stage.side: LearnerState(PPOLearner(own, critic, optimisers, updates), observations)
    }
    keys = jax.random.split(start_key, len(tasks))
    first_games = tuple(_first_games(plan, own, *each) for each in zip(tasks, keys, strict=True))
    return TrainState(first_games, learners, train_key, iterations, env_steps, episodes)


@functools.partial(jax.jit, static_argnames="plan")
def _first_games(
    plan: Plan, network: QNetwork, task: TrainingTask, key: PRNGKeyArray
) -> RestartBuffer:
    bits = jnp.zeros((2, plan.learner.games), jnp.uint32)
    starts = reset_batch(task.game, key, bits.shape[1])
    return RestartBuffer(
        init_games(task.game, starts, _players(plan, network, task), bits), empty_restarts(starts)
    )


def _players(plan: Plan, network: QNetwork, task: TrainingTask) -> BySide[AbstractPlayers]:
    """Return the learner and its opponents, each in games of its own."""
    config, stage = _configs(plan)
    games = equal_parts(config.games, len(task.opponents))
    learner = single_player(_sampling_policy(plan, network))
    return BySide.of(stage.side, learner, PartitionedPlayers(task.opponents, tuple(games)))


def _sampling_policy(plan: Plan, network: QNetwork) -> SamplingPolicy:
    config, stage = _configs(plan)
    return SamplingPolicy(network, stage.clearance_margin, config.loss_value, config.hold)


@functools.partial(jax.jit, static_argnames="plan", donate_argnames="state")
def train_response_chunk(
    plan: Plan, state: TrainState, task: TrainingTask
) -> tuple[TrainState, Metrics]:
    """Play a round in a setting, and learn from it."""
    (config, stage), game = _configs(plan), task.game
    key, before = jax.random.fold_in(state.key, state.iterations), state.games
    play_key, start_key, retry_key, learn_key = jax.random.split(key, 4)
    learner = state.learners[stage.side].learner
    assert isinstance(learner, PPOLearner)
    drawn = mix_in_restarts(
        stage.restart_fraction,
        reset_batch(game, start_key, _STARTS * config.games),
        before.lost_states,
        retry_key,
    )
    starts = jax.tree.map(lambda leaf: leaf.reshape(_STARTS, config.games, *leaf.shape[1:]), drawn)
    players = _players(plan, learner.network, task)
    games, played = collect(
        game, players, before.games, starts, play_key, config.steps, with_next_obs=False
    )
    env_steps = state.env_steps + config.env_steps_per_iteration
    row = row_of(plan, played, stage.side)
    after, error = _learn(
        plan, learner, _in_units(game, row), state.iterations, env_steps, learn_key
    )
    observations, num_kept = (
        row.observation.reshape(-1, row.observation.shape[-1]),
        _num_observations(config),
    )
    buffer = add(
        state.learners[stage.side].buffer,
        (observations[:: len(observations) // num_kept][:num_kept],),
    )
    lost = add_losses(before.lost_states, game, before.games.state, played.outcome, stage.side)
    restart_buffer = RestartBuffer(games, lost)
    return after_iteration(
        state, restart_buffer, played, env_steps, {stage.side: (LearnerState(after, buffer), error)}
    )


def _num_observations(config: PPOConfig) -> int:
    """Return the number of observations that are stored of each round."""
    return max(1, config.env_steps_per_iteration // _ROUNDS_SEEN)


def _in_units(game: Game, row: Row) -> Row:
    """Return transitions with rewards in units of a capture's."""
    unit = game.reward.capture if game.reward.profile == "paper" else 1.0
    return replace(row, reward=row.reward / unit)


def advantages(
    config: PPOConfig, row: Row, values: Float[Array, "steps games"]
) -> Float[Array, "steps games"]:
    """Estimate the advantages of actions by generalised advantage estimation (Schulman et al.,
    2016).

    A game that is truncated, and one that the last step leaves under way, is worth what it was
    before that step.
    """
    following = jnp.concatenate([values[1:], values[-1:]])
    following = jnp.where(row.terminated, 0.0, jnp.where(row.truncated, values, following))
    errors = row.reward + config.gamma * following - values

    def earlier(later: Array, step: tuple[Array, Array]) -> tuple[Array, Array]:
        error, ended = step
        advantage = error + config.gamma * config.trace * jnp.where(ended, 0.0, later)
        return advantage, advantage

    ended = row.terminated | row.truncated
    return jax.lax.scan(earlier, jnp.zeros_like(values[0]), (errors, ended), reverse=True)[1]


class _LearnBatch(eqx.Module):
    """The rows that updates learn from: observations and actions, their logarithmic probabilities
    in the games, their advantages, the critic's targets, and whether they count.
    """

    observation: Float[Array, "rows size"]
    action: Int[Array, " rows"]
    probability: Float[Array, " rows"]
    advantage: Float[Array, " rows"]
    value: Float[Array, " rows"]
    counts: Bool[Array, " rows"]


def _learn(
    plan: Plan,
    learner: PPOLearner,
    row: Row,
    iterations: Int[Array, ""],
    env_steps: Int[Array, ""],
    key: PRNGKeyArray,
) -> tuple[PPOLearner, Scalar]:
    """Learn from a round; return the learner after it and the critic's errors, added up over its
    updates.
    """
    config, _ = _configs(plan)
    shape = row.reward.shape
    flat = jax.tree.map(lambda leaf: leaf.reshape(row.reward.size, *leaf.shape[2:]), row)
    values = apply_to_batch(learner.critic, flat.observation)[:, 0]
    gained = advantages(config, row, values.reshape(shape)).ravel()
    before = _of_actions(
        _sampling_policy(plan, learner.network).log_probabilities(flat.observation), flat.action
    )
    round_batch = _LearnBatch(
        flat.observation, flat.action, before, gained, gained + values, flat.active
    )
    keys = jax.random.split(key, config.epochs)
    order = jnp.concatenate([jax.random.permutation(key, len(values)) for key in keys])
    rates = _learning_rates(plan, iterations, env_steps)

    def update(learner: PPOLearner, rows: Int[Array, " batch"]) -> tuple[PPOLearner, Scalar]:
        parts = learner.network, learner.critic
        some = jax.tree.map(lambda leaf: leaf[rows], round_batch)
        (_, error), gradients = eqx.filter_value_and_grad(_loss, has_aux=True)(parts, plan, some)
        each = zip(_adam, gradients, learner.optimisers, strict=True)
        directions, optimisers = zip(
            *(adam.update(gradient, own) for adam, gradient, own in each), strict=True
        )
        network, critic = (
            eqx.apply_updates(part, jax.tree.map(lambda step, rate=rate: -rate * step, direction))
            for part, direction, rate in zip(parts, directions, rates, strict=True)
        )
        return PPOLearner(network, critic, optimisers, learner.updates + 1), error

    learner, errors = jax.lax.scan(update, learner, order.reshape(-1, config.batch))
    return learner, jnp.sum(errors)


def _learning_rates(
    plan: Plan, iterations: Int[Array, ""], env_steps: Int[Array, ""]
) -> tuple[Scalar, Scalar]:
    """Return the learning rates of the network, which waits for the critic at first, and of the
    critic.
    """
    config, stage = _configs(plan)
    last, over = config.final_learning_rate, stage.env_steps
    rate = interpolate_linearly(config.learning_rate, last, over, env_steps)
    critic_rate = interpolate_linearly(config.critic_learning_rate, last, over, env_steps)
    return jnp.where(iterations < config.critic_first, 0.0, rate), critic_rate


def _loss(
    parts: tuple[QNetwork, Layers], plan: Plan, round_batch: _LearnBatch
) -> tuple[Scalar, Scalar]:
    """Return the loss of both networks on a batch, and the critic's mean squared error in it."""
    (network, critic), (config, _) = parts, _configs(plan)
    logarithms = _sampling_policy(plan, network).log_probabilities(round_batch.observation)
    ratio = jnp.exp(_of_actions(logarithms, round_batch.action) - round_batch.probability)
    mean = functools.partial(jnp.mean, where=round_batch.counts)
    gain = (round_batch.advantage - mean(round_batch.advantage)) / (
        jnp.std(round_batch.advantage, where=round_batch.counts) + 1e-6
    )
    clipped = jnp.clip(ratio, 1 - config.clip, 1 + config.clip)
    gains = mean(jnp.minimum(ratio * gain, clipped * gain))
    entropy = -mean(jnp.sum(jnp.exp(logarithms) * logarithms, axis=1))
    error = mean((apply_to_batch(critic, round_batch.observation)[:, 0] - round_batch.value) ** 2)
    return error - gains - config.entropy * entropy, error


def _of_actions(
    logarithms: Float[Array, "rows 9"], actions: Int[Array, " rows"]
) -> Float[Array, " rows"]:
    return jnp.take_along_axis(logarithms, actions[:, None], axis=1)[:, 0]


def _configs(plan: Plan) -> tuple[PPOConfig, ResponseConfig]:
    assert isinstance(plan.learner, PPOConfig)
    assert isinstance(plan.stage, ResponseConfig)
    return plan.learner, plan.stage
