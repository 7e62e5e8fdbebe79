"""Soft actor-critic with twin critics and a temperature of its own: targets, losses, one update.

Haarnoja et al., "Soft actor-critic algorithms and applications" (2018); equation numbers are that
paper's.
"""

from dataclasses import dataclass
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int, PRNGKeyArray

from apollonius.agents.network import (
    GaussianActor,
    Layers,
    apply_to_batch,
    interpolate_weights,
    make_actor,
    make_layers,
)
from apollonius.agents.trained import SquashedGaussian
from apollonius.game.types import Scalar
from apollonius.io.errors import require, require_positive, require_within
from apollonius.learn.algorithm import descend
from apollonius.learn.replay_algorithm import ReplayAlgorithm
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

    `average` is the running average of the actor's weights: which plays in evaluations. `target` is
    that of the critics. `log_temperature` is the logarithm of alpha.
    """

    network: GaussianActor
    average: GaussianActor
    critics: Critics
    target: Critics
    log_temperature: Scalar
    optimiser: optax.OptState
    updates: Int[Array, ""]


_adam = optax.scale_by_adam()


def sample_actions(
    actor: GaussianActor, observations: Float[Array, "batch size"], noise: Actions
) -> tuple[Actions, Float[Array, " batch"]]:
    """Return actions drawn by the actor with standard normal noise, by its weights, and their log
    densities (Eq. 20).

    With u normal and a = tanh(u), the density of a is that of u over 1 - tanh(u)^2, whose logarithm
    is written as 2 (log 2 - u - softplus(-2 u)), which neither overflows nor loses its digits far
    out.
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
    """Return the mean of `alpha log pi(a | s) - min(Q_1, Q_2)(s, a)` (Eq. 7), and the mean log
    density of actions.
    """
    actions, log_density = sample_actions(actor, batch.observation, noise)
    values = jnp.min(critics.batch(batch.observation, actions), axis=0)
    return jnp.mean(temperature * log_density - values), jnp.mean(log_density)


@dataclass(frozen=True)
class SACConfig(ReplayAlgorithm):
    """Soft actor-critic (Haarnoja et al., "Soft actor-critic algorithms and applications", 2018),
    for pairs of action levels; n-step returns as in deep Q-learning.
    """

    kind: Literal["sac"] = "sac"
    network = GaussianActor
    continuous = True
    depth: int = 3
    final_n_step: int = 8
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-4
    averaging: float = 1e-3
    env_steps_per_update: int = 256
    target_averaging: float = 2e-2
    """Part of the way that the target critics go towards the critics at each update (tau)."""
    target_entropy: float = -1.0
    """Mean entropy of a state's actions that the temperature is tuned to [nats, of action levels in
    [-1, 1]]; uniformly random ones have 1.39. The paper's rule, minus the number of controls, would
    be -2: too sure too early of the side on which to pass a disc.
    """
    first_temperature: float = 0.1
    """The temperature before the first update."""
    noise_steps: int = 16
    """Steps for which a game holds the noise of its actions (as in gSDE: Raffin et al., "Smooth
    exploration for robotic reinforcement learning", 2021): a robot of bounded acceleration averages
    away what is new every 0.1 s.
    """
    critics_first: int = 500
    """Updates of the critics alone before the actor learns: they begin from random weights even
    where it does not.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "target_averaging", "first_temperature")
        require_within(self, 0, 1, "target_averaging")
        require_within(
            self, -1_000, 1.38, "target_entropy"
        )  # of uniformly random actions it is 2 log(2) = 1.386
        require_within(self, 0, 2**31 - 1, "critics_first")
        whole = self.noise_steps >= 1 and self.noise_steps % self.steps_per_iteration == 0
        bound = f"a multiple of env_steps_per_update / games = {self.steps_per_iteration}"
        require(whole, "noise_steps", self.noise_steps, bound)

    def loss_value(self, failure: float) -> None:
        """Return None: an actor does not value games."""
        return

    def explorer(self, network: GaussianActor, exploration: Scalar) -> SquashedGaussian:
        """Return the player that draws from the actor's distributions."""
        return SquashedGaussian(network, exploration)

    def noise_block(self, iterations: Int[Array, ""]) -> Int[Array, ""] | None:
        if self.noise_steps <= self.steps_per_iteration:
            return None
        return iterations // (self.noise_steps // self.steps_per_iteration)

    def init_learner(self, key: PRNGKeyArray, network: Any = None) -> SACLearner:
        """Return a learner that starts from a copy of an actor, or from random weights; its critics
        begin from random weights. The key is consumed.
        """
        actor = network
        if actor is None:
            actor_key, key = jax.random.split(key)
            actor = make_actor(self.observation, self.width, self.depth, actor_key)
        sizes = [find_observation(self.observation).size + 2, *[self.width] * self.depth, 1]
        critics = Critics(*(make_layers(sizes, critic_key) for critic_key in jax.random.split(key)))
        own, average, critics, target = (
            jax.tree.map(jnp.copy, part) for part in (actor, actor, critics, critics)
        )
        log_temperature = jnp.asarray(jnp.log(self.first_temperature), jnp.float32)
        weights: Any = (own, critics, log_temperature)
        optimiser = _adam.init(weights)
        updates = jnp.zeros((), jnp.int32)
        return SACLearner(own, average, critics, target, log_temperature, optimiser, updates)

    def update(
        self, learner: SACLearner, batch: TransitionBatch, learning_rate: Scalar, key: PRNGKeyArray
    ) -> tuple[SACLearner, Scalar]:
        """Return the learner after one step of Adam on a batch, and the critics' loss before it.
        The key is consumed.

        Targets are `reward + discount * (min(Q_1, Q_2)(s', a') - alpha log pi(a' | s'))` (Eq. 3 and
        5). Over several steps the entropy on the way is left out.
        """
        noise_key = jax.random.fold_in(key, 2)
        noise, next_noise = jax.random.normal(noise_key, (2, *batch.action.shape))
        temperature = jnp.exp(learner.log_temperature)
        next_action, next_density = sample_actions(
            learner.network, batch.next_observation, next_noise
        )
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
        # The gradient of -log(alpha) (log pi + target entropy) by log(alpha) (Eq. 18).
        of_temperature = -(log_density + self.target_entropy)
        gradient: Any = (of_actor, of_critics, of_temperature)
        direction: Any
        direction, optimiser = _adam.update(gradient, learner.optimiser)
        of_actor, of_critics, of_temperature = direction
        acts = (learner.updates >= self.critics_first).astype(jnp.float32)
        network = descend(learner.network, of_actor, acts * learning_rate)
        critics = descend(learner.critics, of_critics, learning_rate)
        average = interpolate_weights(learner.average, network, self.averaging)
        target = interpolate_weights(learner.target, critics, self.target_averaging)
        log_temperature = learner.log_temperature - acts * learning_rate * of_temperature
        return SACLearner(
            network, average, critics, target, log_temperature, optimiser, learner.updates + 1
        ), loss
