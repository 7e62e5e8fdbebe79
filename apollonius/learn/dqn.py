"""Deep Q-learning (Eq. 3): targets, loss, one update."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int, PRNGKeyArray

from apollonius.agents.network import Network, QNetwork, make_network
from apollonius.game.types import Scalar, tree_where
from apollonius.learn.learner_config import DQNConfig
from apollonius.learn.replay_buffer import TransitionBatch


class DQNLearner(eqx.Module):
    """One side's networks and optimiser. `updates` counts the updates so far.

    `average` is the running average of the network's weights (Polyak averaging), which plays in evaluations.
    """

    network: QNetwork
    target: QNetwork
    average: QNetwork
    optimiser: optax.OptState
    updates: Int[Array, ""]


_adam = optax.scale_by_adam()


def init_learner(
    config: DQNConfig, key: PRNGKeyArray, network: Network | None = None
) -> DQNLearner:
    """Return a learner that starts from a copy of a network, or from random weights. The key is consumed."""
    first = network or make_network(
        config.observation, config.width, config.depth, key, config.symmetric
    )
    assert isinstance(first, QNetwork)
    own, target, average = (jax.tree.map(jnp.copy, first) for _ in range(3))
    return DQNLearner(
        own, target, average, _adam.init(eqx.filter(own, eqx.is_array)), jnp.zeros((), jnp.int32)
    )


def q_target(
    reward: Scalar, discount: Scalar, next_values: Float[Array, "9"], next_choice: Float[Array, "9"]
) -> Scalar:
    """Return `reward + discount * Q_target(s', a*)` (Eq. 3); the discount is 0 where the game ended by its rules.

    `a*` is the best action by `next_choice`, the target network's values (Eq. 3) or the online network's (double).
    """
    return reward + discount * next_values[jnp.argmax(next_choice)]


def loss(network: QNetwork, target: QNetwork, batch: TransitionBatch, double: bool) -> Scalar:
    """Return the mean squared temporal-difference error of a batch (Eq. 3)."""
    values = network.batch(batch.observation)
    next_values = target.batch(batch.next_observation)
    next_choice = network.batch(batch.next_observation) if double else next_values
    targets = jax.vmap(q_target)(batch.reward, batch.discount, next_values, next_choice)
    chosen = jnp.take_along_axis(values, batch.action[:, None], axis=1)[:, 0]
    errors = (jax.lax.stop_gradient(targets) - chosen) ** 2
    return (
        jnp.mean(errors) if batch.active is None else jnp.mean(jnp.where(batch.active, errors, 0.0))
    )


def update(
    learner: DQNLearner, batch: TransitionBatch, learning_rate: Scalar, config: DQNConfig
) -> tuple[DQNLearner, Scalar]:
    """Return the learner after one step of Adam on a batch, and the loss before it."""
    value, gradient = eqx.filter_value_and_grad(loss)(
        learner.network, learner.target, batch, config.double
    )
    return adam_step(learner, gradient, learning_rate, config), value


def adam_step(
    learner: DQNLearner, gradient: Any, learning_rate: Scalar, config: DQNConfig
) -> DQNLearner:
    """Return the learner after one step of Adam along a gradient; the averaged weights go towards the network."""
    direction, optimiser = _adam.update(gradient, learner.optimiser)
    network = eqx.apply_updates(
        learner.network, jax.tree.map(lambda step: -learning_rate * step, direction)
    )
    average = network
    if config.averaging < 1:
        average = jax.tree.map(
            lambda old, new: old + config.averaging * (new - old), learner.average, network
        )
    return DQNLearner(network, learner.target, average, optimiser, learner.updates + 1)


def copy_to_target(learner: DQNLearner, due: Array) -> DQNLearner:
    """Return the learner with its target network set to its network, where that is due (Algorithm 1, line 11)."""
    target = tree_where(due, learner.network, learner.target)
    return eqx.tree_at(lambda this: this.target, learner, target)
