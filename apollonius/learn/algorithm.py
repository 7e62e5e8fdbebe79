"""What a stage of training asks of an algorithm: a few pure functions, chosen by the kind of its configuration."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.network import GaussianActor, Network, QNetwork, widened
from apollonius.game.types import Real, Scalar
from apollonius.io.errors import require
from apollonius.learn import dqn, sac
from apollonius.learn.learner_config import DQNConfig, LearnerConfig, SACConfig
from apollonius.learn.replay_buffer import CONTINUOUS, DISCRETE, Batch
from apollonius.observe.registry import find_observation

Learner = dqn.DQNLearner | sac.SACLearner
"""One side's networks and optimisers. All have `network`, which plays while it learns, `average`, which plays when it
counts, and `updates`, their number so far."""


def linear(start: Real, end: Real, over: Real, env_steps: Int[Array, ""]) -> Scalar:
    """From `start` to `end` in a straight line over the first `over` env steps, then constant."""
    fraction = jnp.clip(env_steps.astype(jnp.float32) / jnp.maximum(over, 1), 0.0, 1.0)
    value: Real = start + (end - start) * fraction
    return value


@dataclass(frozen=True)
class UpdateContext:
    """Where in a stage an update is made.

    Attributes:
        env_steps: played so far, those of this iteration included.
        stage: env steps of the whole stage.
    """

    env_steps: Int[Array, ""]
    stage: int

    def between(self, first: Real, last: Real) -> Scalar:
        """What goes from the first number to the last one, in a straight line over the stage."""
        return linear(first, last, self.stage, self.env_steps)


@dataclass(frozen=True)
class Algorithm:
    """How a side learns.

    Attributes:
        network: class of what its agents play by.
        action: shape and number type of its actions.
        init: a learner from scratch. The key is consumed.
        start_from: a learner that goes on from a network, which is copied. The key is consumed.
        update: a learner after one update from a batch, and its loss. The key is consumed.
        after_updates: a learner at the end of an iteration.
        exploration: how much an agent explores that begins with a given share of random actions.
        noise_steps: steps for which a game keeps the random bits that it explores by.
    """

    network: type[Network]
    action: jax.ShapeDtypeStruct
    init: Callable[[Any, PRNGKeyArray], Learner]
    start_from: Callable[[Any, Any, PRNGKeyArray], Learner]
    update: Callable[[Any, Batch, PRNGKeyArray, Any, UpdateContext], tuple[Learner, Scalar]]
    after_updates: Callable[[Any, Any, Int[Array, ""]], Learner]
    exploration: Callable[[Any, float, int, Int[Array, ""]], Scalar]
    noise_steps: Callable[[Any], int]


def algorithm_of(config: LearnerConfig) -> Algorithm:
    """The algorithm that a configuration is of."""
    return ALGORITHMS[type(config)]


def shape_of(network: Network) -> tuple[str, int, int]:
    """The observation, depth and width that a network was made for."""
    return network.observation.name, len(network.layers) - 1, int(network.layers[0].out_features)


def fitted(network: Network, config: LearnerConfig, name: str, value: object) -> Network:
    """A network as a configuration trains it: itself or, if what is to be read begins with what it reads, the same with
    weights of 0 for what is new.

    Args:
        name, value: what the user gave, for the message.

    Raises:
        InvalidInput: naming both kinds.
    """
    if (reads := find_observation(config.observation)).extends == network.observation.name:
        network = widened(network, reads)
    made_for = shape_of(network)
    wanted = (config.observation, config.depth, config.width)
    bound = f"an agent with (observation, depth, width) = {wanted} as this config trains, not {made_for}"
    require(made_for == wanted, name, value, bound)
    kind = algorithm_of(config).network
    require(isinstance(network, kind), name, value, f"a {kind.__name__} as this config trains")
    return network


def _update_values(
    learner: dqn.DQNLearner, batch: Batch, key: PRNGKeyArray, config: DQNConfig, context: UpdateContext
) -> tuple[dqn.DQNLearner, Scalar]:
    rate = context.between(config.learning_rate, config.final_learning_rate)
    return dqn.update(learner, batch, rate, config)


def _copy_when_due(learner: dqn.DQNLearner, config: DQNConfig, env_steps: Int[Array, ""]) -> dqn.DQNLearner:
    due = env_steps // config.target_period > (env_steps - config.env_steps_per_iteration) // config.target_period
    return dqn.copy_to_target(learner, due)


def _update_actor(
    learner: sac.SACLearner, batch: Batch, key: PRNGKeyArray, config: SACConfig, context: UpdateContext
) -> tuple[sac.SACLearner, Scalar]:
    rate = context.between(config.learning_rate, config.final_learning_rate)
    return sac.update(learner, batch, key, rate, config)


ALGORITHMS: dict[type[LearnerConfig], Algorithm] = {
    DQNConfig: Algorithm(
        network=QNetwork,
        action=DISCRETE,
        init=dqn.init,
        start_from=lambda config, network, key: dqn.start_from(network),
        update=_update_values,
        after_updates=_copy_when_due,
        exploration=lambda config, first, stage, env_steps: linear(
            first, config.final_epsilon, config.exploration_fraction * stage, env_steps
        ),
        noise_steps=lambda config: 1,
    ),
    SACConfig: Algorithm(
        network=GaussianActor,
        action=CONTINUOUS,
        init=sac.init,
        start_from=sac.start_from,
        update=_update_actor,
        after_updates=lambda learner, config, env_steps: learner,
        exploration=lambda config, first, stage, env_steps: jnp.ones(()),
        noise_steps=lambda config: config.noise_steps,
    ),
}
"""By the kind of their configuration. The actors of `SACConfig` explore by the entropy that they keep."""
