"""Networks: an observation in, the value of each action out (Fig. 3), or a distribution over pairs
of action levels.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from apollonius.game.dynamics import MIRRORED
from apollonius.game.types import NUM_ACTIONS
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.registry import find_observation

T = TypeVar("T")
Layers = tuple[eqx.nn.Linear, ...]
"""Fully connected layers with ReLU between them (section III-D of the paper: four hidden layers of
256 units).
"""


class QNetwork(eqx.Module):
    """The value of each of the 9 actions (Fig. 3).

    Attributes:
        symmetric: True to average the value of each action with that of its mirror image in the
            mirrored observation. The game has this symmetry (van der Pol et al., "MDP homomorphic
            networks", 2020).
    """

    layers: Layers
    observation: AbstractObservation = eqx.field(static=True)
    symmetric: bool = eqx.field(static=True, default=False)

    def __call__(self, observation: Float[Array, " size"]) -> Float[Array, "9"]:
        values = apply_layers(self.layers, observation)
        if not self.symmetric:
            return values
        assert self.observation.mirror, "it knows its mirror image"
        mirrored_values = apply_layers(self.layers, self.observation.mirror(observation))
        return (values + mirrored_values[np.array(MIRRORED)]) / 2

    def batch(self, observations: Float[Array, "batch size"]) -> Float[Array, "batch 9"]:
        """Return the action values for a batch."""
        return jax.vmap(self)(observations)


class GaussianActor(eqx.Module):
    """A normal distribution of either action level, before `tanh` makes a number in [-1, 1] of it.

    Haarnoja et al., "Soft actor-critic" (2018), appendix C.
    """

    layers: Layers
    observation: AbstractObservation = eqx.field(static=True)

    def __call__(
        self, observation: Float[Array, " size"]
    ) -> tuple[Float[Array, "2"], Float[Array, "2"]]:
        """Return the means and standard deviations that the last layer's outputs stand for."""
        mean, spread = jnp.split(apply_layers(self.layers, observation), 2)
        least, most = _LOG_DEVIATION
        return mean, jnp.exp(least + (most - least) * (jnp.tanh(spread) + 1) / 2)

    def batch(
        self, observations: Float[Array, "batch size"]
    ) -> tuple[Float[Array, "batch 2"], Float[Array, "batch 2"]]:
        """Return the means and standard deviations for a batch."""
        return jax.vmap(self)(observations)


MOST_WIDTH = 8_192
"""Most units of a hidden layer."""
MOST_LAYERS = 64
"""Most hidden layers."""
Network = QNetwork | GaussianActor
"""Network of a trained agent."""
_LOG_DEVIATION = (-5.0, 1.0)
"""Bounds of the logarithm of a standard deviation: wider ones make `tanh` saturate, narrower ones
never explore.
"""


def one_action_network(network: QNetwork, action: int) -> QNetwork:
    """Return a network of the same shape with the value 1 for one action and 0 for all others."""
    blank = jax.tree.map(jnp.zeros_like, network)
    return eqx.tree_at(
        lambda tree: tree.layers[-1].bias, blank, jax.nn.one_hot(action, NUM_ACTIONS)
    )


def apply_layers(layers: Layers, inputs: Float[Array, " in"]) -> Float[Array, " out"]:
    """Return the outputs of the layers for one input."""
    hidden = inputs
    for layer in layers[:-1]:
        hidden = jax.nn.relu(layer(hidden))
    return layers[-1](hidden)


def apply_to_batch(layers: Layers, inputs: Float[Array, "batch in"]) -> Float[Array, "batch out"]:
    """Return the outputs of the layers for a batch."""
    return jax.vmap(apply_layers, in_axes=(None, 0))(layers, inputs)


def make_layers(sizes: Sequence[int], key: PRNGKeyArray) -> Layers:
    """Return layers with random weights; `sizes` are their inputs and at last the outputs. The key
    is consumed.
    """
    keys = jax.random.split(key, len(sizes) - 1)
    return tuple(
        eqx.nn.Linear(fan_in, fan_out, key=layer_key)
        for fan_in, fan_out, layer_key in zip(sizes, sizes[1:], keys, strict=False)
    )


def widen_inputs(network: Network, reads: AbstractObservation) -> Network:
    """Widen a network for a longer observation, of whose first numbers it makes the same
    outputs.
    """
    first, more = network.layers[0], reads.size - network.observation.size
    weight = jnp.pad(first.weight, ((0, 0), (0, more)))
    empty = eqx.nn.Linear(reads.size, first.out_features, key=jax.random.key(0))
    wide = eqx.tree_at(lambda layer: (layer.weight, layer.bias), empty, (weight, first.bias))
    return replace(network, layers=(wide, *network.layers[1:]), observation=reads)


def scale_outputs(network: Network, factor: float) -> Network:
    """Return a network whose outputs are another one's, times a factor."""
    last = network.layers[-1]
    assert last.bias is not None
    weights = last.weight * factor, last.bias * factor
    return eqx.tree_at(
        lambda tree: (tree.layers[-1].weight, tree.layers[-1].bias), network, weights
    )


def interpolate_weights(weights: T, other: T, share: float) -> T:
    """Move weights a share of the distance towards others of the same shapes."""
    return jax.tree.map(lambda first, second: first + share * (second - first), weights, other)


def make_network(
    observation: str, width: int, depth: int, key: PRNGKeyArray, symmetric: bool = False
) -> QNetwork:
    """Return a network of action values with random weights.

    Args:
        observation: name of the observation that it reads.
        width: units of each hidden layer.
        depth: number of hidden layers.
        key: draws the weights; it is consumed.
        symmetric: as in `QNetwork`.
    """
    reads = find_observation(observation)
    return QNetwork(make_layers([reads.size, *[width] * depth, NUM_ACTIONS], key), reads, symmetric)


def make_actor(observation: str, width: int, depth: int, key: PRNGKeyArray) -> GaussianActor:
    """Return an actor with random weights.

    Args:
        observation: name of the observation that it reads.
        width: units of each hidden layer.
        depth: number of hidden layers.
        key: draws the weights; it is consumed.
    """
    reads = find_observation(observation)
    return GaussianActor(make_layers([reads.size, *[width] * depth, 4], key), reads)
