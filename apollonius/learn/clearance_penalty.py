"""A clearance penalty in nine rarely used units of a trained network.

What a network learns of walls and bodies is blurred, and teaching it the sharp edge of what a
shield forbids costs it the differences between good actions. So the edge is not learned: nine units
of each layer carry what each action lacks of a wanted clearance after braking
(`apollonius.observe.braking`).
"""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
from equinox import tree_at
from equinox.nn import Linear
from jaxtyping import Array, Float

from apollonius.agents.network import Network, QNetwork
from apollonius.game.types import NUM_ACTIONS, Real
from apollonius.learn.replay_buffer import ReplayBuffer
from apollonius.observe.egocentric import BRAKING, ROOM

COST = 30.0
"""Cost of a metre of missing clearance, in lost games, on the scale of the paper's robots: of 3 cm,
most of one.
"""
_ROWS = 20_000


def clearance_penalty(
    observations: Float[Array, "*rows size"], margin: Real, loss_value: Real
) -> Float[Array, "*rows 9"]:
    """Compute the penalty of each action that leaves less than the clearance margin.

    Args:
        observations: `egocentric`, or those that begin with it.
        margin: the clearance that an action should leave a robot that then brakes [m].
        loss_value: value of a lost game.
    """
    after = observations[..., BRAKING : BRAKING + NUM_ACTIONS]
    return COST * ROOM * loss_value * jax.nn.relu(margin / ROOM - after)


def with_clearance_penalty(
    network: QNetwork, observations: Float[Array, "rows size"], margin: Real, loss_value: Real
) -> QNetwork:
    """Encode a `clearance_penalty` in a network of action values.

    The units that are given up are the nine of each layer that vary least in the observations:
    their means go into the next layer's biases, so that units that are never active change nothing.
    """
    actions = jnp.arange(NUM_ACTIONS)
    layers = list[Linear]()
    hidden = observations
    carried, means = BRAKING + actions, jnp.zeros(NUM_ACTIONS)
    for number, layer in enumerate(network.layers):
        weight, bias = layer.weight, layer.bias
        assert bias is not None
        if number:
            bias = bias + weight[:, carried] @ means
            weight = weight.at[:, carried].set(0.0)
        if layer is network.layers[-1]:
            weight = weight.at[actions, carried].set(-COST * ROOM * loss_value)
        else:
            hidden = jax.nn.relu(jax.vmap(layer)(hidden))
            units = jnp.argsort(jnp.std(hidden, axis=0))[:NUM_ACTIONS]
            weight = weight.at[units].set(0.0).at[units, carried].set(1.0 if number else -1.0)
            bias = bias.at[units].set(0.0 if number else margin / ROOM)
            carried, means = units, jnp.mean(hidden[:, units], axis=0)
        layers.append(tree_at(lambda affine: (affine.weight, affine.bias), layer, (weight, bias)))
    return replace(network, layers=tuple(layers))


def sample_observations(buffer: ReplayBuffer[Any]) -> Float[Array, "rows size"]:
    """Return observations of a student's buffer, evenly spaced, `_ROWS` or a few more."""
    filled = int(buffer.filled)
    return buffer.rows[0][: filled : max(1, filled // _ROWS)]


def without_clearance_penalty(network: Network) -> Network:
    """Remove the clearance penalty from a network; one without it is returned as it is.

    In a training that moves all weights the units that carry them would drift, and what drifts by a
    hundredth costs several lost games.
    """
    actions, carried = jnp.arange(NUM_ACTIONS), BRAKING + jnp.arange(NUM_ACTIONS)
    if not isinstance(network, QNetwork) or network.observation.size <= BRAKING:
        return network
    for number, layer in enumerate(network.layers[:-1]):
        reads = (
            jnp.zeros((NUM_ACTIONS, layer.weight.shape[1]))
            .at[actions, carried]
            .set(1.0 if number else -1.0)
        )
        alike = jnp.all(layer.weight[None] == reads[:, None], axis=2)
        if not jnp.all(jnp.any(alike, axis=1)):
            return network
        carried = jnp.argmax(alike, axis=1)
    weight = network.layers[-1].weight.at[actions, carried].set(0.0)
    return tree_at(lambda whole: whole.layers[-1].weight, network, weight)
