"""Soft actor-critic with twin critics and a temperature of its own: targets, losses, one update.

Haarnoja et al., "Soft actor-critic algorithms and applications" (2018); equation numbers are that paper's.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int, PRNGKeyArray

from apollonius.agents.network import (
    GaussianActor,
    Layers,
    Network,
    apply_to_batch,
    make_actor,
    make_layers,
)
from apollonius.game.types import Scalar
from apollonius.learn.learner_config import SACConfig
from apollonius.learn.replay_buffer import TransitionBatch
from apollonius.observe.registry import find_observation

Actions = Float[Array, "batch 2"]
"""Pairs of action levels in [-1, 1]."""


class Critics(eqx.Module):
    """Two estimates of the value of an action, of which the lower one counts."""

    first: Layers
    second: Layers

    def batch(
        self, observations: Float[Array, "batch size"], actions: Actions
    ) -> Float[Array, "2 batch"]:
        """Return both values of an action in every state."""
        inputs = jnp.concatenate([observations, actions], axis=1)
        return jnp.stack(
            [apply_to_batch(layers, inputs)[:, 0] for layers in (self.first, self.second)]
        )


class SACLearner(eqx.Module):
    """One side's networks and optimisers. `updates` counts the updates so far.

    `average` is the running average of the actor's weights: which plays in evaluations. `target` is that of the
    critics. `log_temperature` is the logarithm of alpha.
    """

    network: GaussianActor
    average: GaussianActor
    critics: Critics
    target: Critics
    log_temperature: Scalar
    optimiser: optax.OptState
    updates: Int[Array, ""]


_adam = optax.scale_by_adam()


def init_actor_critic(
    config: SACConfig, key: PRNGKeyArray, actor: Network | None = None
) -> SACLearner:
    """Return a learner that starts from a copy of an actor, or from random weights; its critics begin from random
    weights. The key is consumed.
    """
    if actor is None:
        actor_key, key = jax.random.split(key)
        actor = make_actor(config.observation, config.width, config.depth, actor_key)
    assert isinstance(actor, GaussianActor)
    sizes = [find_observation(config.observation).size + 2, *[config.width] * config.depth, 1]
    critics = Critics(*(make_layers(sizes, critic_key) for critic_key in jax.random.split(key)))
    network, average, critics, target = (
        jax.tree.map(jnp.copy, part) for part in (actor, actor, critics, critics)
    )
    log_temperature = jnp.asarray(jnp.log(config.first_temperature), jnp.float32)
    weights: Any = (network, critics, log_temperature)
    optimiser = _adam.init(weights)
    return SACLearner(
        network, average, critics, target, log_temperature, optimiser, jnp.zeros((), jnp.int32)
    )


def sample_actions(
    actor: GaussianActor, observations: Float[Array, "batch size"], noise: Actions
) -> tuple[Actions, Float[Array, " batch"]]:
    """Return actions drawn by the actor with standard normal noise, by its weights, and their log densities (Eq. 20).

    With u normal and a = tanh(u), the density of a is that of u over 1 - tanh(u)^2, whose logarithm is written as
    2 (log 2 - u - softplus(-2 u)), which neither overflows nor loses its digits far out.
    """
    mean, deviation = actor.batch(observations)
    before = mean + deviation * noise
    normal = -0.5 * noise**2 - jnp.log(deviation) - 0.5 * jnp.log(2 * jnp.pi)
    squashing = 2 * (jnp.log(2.0) - before - jax.nn.softplus(-2 * before))
    return jnp.tanh(before), jnp.sum(normal - squashing, axis=1)


def critics_loss(
    critics: Critics, batch: TransitionBatch, targets: Float[Array, " batch"]
) -> Scalar:
    """Return the mean squared error of both critics against the same targets, added up (Eq. 5)."""
    values = critics.batch(batch.observation, batch.action)
    return jnp.sum(jnp.mean((values - targets[None]) ** 2, axis=1))


def actor_loss(
    actor: GaussianActor,
    critics: Critics,
    temperature: Scalar,
    batch: TransitionBatch,
    noise: Actions,
) -> tuple[Scalar, Scalar]:
    """Return the mean of `alpha log pi(a | s) - min(Q_1, Q_2)(s, a)` (Eq. 7), and the mean log density of actions."""
    actions, log_density = sample_actions(actor, batch.observation, noise)
    values = jnp.min(critics.batch(batch.observation, actions), axis=0)
    return jnp.mean(temperature * log_density - values), jnp.mean(log_density)


def update_actor_critic(
    learner: SACLearner,
    batch: TransitionBatch,
    key: PRNGKeyArray,
    learning_rate: Scalar,
    config: SACConfig,
) -> tuple[SACLearner, Scalar]:
    """Return the learner after one step of Adam on a batch, and the critics' loss before it. The key is consumed.

    Targets are `reward + discount * (min(Q_1, Q_2)(s', a') - alpha log pi(a' | s'))` (Eq. 3 and 5); over several steps
    the entropy on the way is left out.
    """
    noise, next_noise = jax.random.normal(key, (2, *batch.action.shape))
    temperature = jnp.exp(learner.log_temperature)
    next_action, next_density = sample_actions(learner.network, batch.next_observation, next_noise)
    next_values = learner.target.batch(batch.next_observation, next_action)
    targets = batch.reward + batch.discount * (
        jnp.min(next_values, axis=0) - temperature * next_density
    )
    loss, of_critics = eqx.filter_value_and_grad(critics_loss)(
        learner.critics, batch, jax.lax.stop_gradient(targets)
    )
    (_, log_density), of_actor = eqx.filter_value_and_grad(actor_loss, has_aux=True)(
        learner.network, learner.critics, temperature, batch, noise
    )
    of_temperature = -(
        log_density + config.target_entropy
    )  # of -log(alpha) times that, by log(alpha) (Eq. 18)
    gradient: Any = (of_actor, of_critics, of_temperature)
    direction: Any
    direction, optimiser = _adam.update(gradient, learner.optimiser)
    of_actor, of_critics, of_temperature = direction
    acts = (learner.updates >= config.critics_first).astype(jnp.float32)
    network = eqx.apply_updates(
        learner.network, jax.tree.map(lambda step: -acts * learning_rate * step, of_actor)
    )
    critics = eqx.apply_updates(
        learner.critics, jax.tree.map(lambda step: -learning_rate * step, of_critics)
    )
    average = jax.tree.map(
        lambda old, new: old + config.averaging * (new - old), learner.average, network
    )
    target = jax.tree.map(
        lambda old, new: old + config.target_averaging * (new - old), learner.target, critics
    )
    log_temperature = learner.log_temperature - acts * learning_rate * of_temperature
    return SACLearner(
        network, average, critics, target, log_temperature, optimiser, learner.updates + 1
    ), loss
