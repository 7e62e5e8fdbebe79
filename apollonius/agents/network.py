"""The action-value network (Fig. 3): an observation in, one value per action out."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from apollonius.game.observation import OBSERVATION_SIZES
from apollonius.game.types import NUM_ACTIONS


class QNetwork(eqx.Module):
    """Fully connected layers with ReLU (section III-D of the paper: four hidden layers of 256 units)."""

    layers: tuple[eqx.nn.Linear, ...]
    observation: str = eqx.field(static=True)

    def __call__(self, observation: Float[Array, " size"]) -> Float[Array, "9"]:
        """The values of the 9 actions for one observation in the network's profile."""
        hidden = observation
        for layer in self.layers[:-1]:
            hidden = jax.nn.relu(layer(hidden))
        return self.layers[-1](hidden)

    def batch(self, observations: Float[Array, "batch size"]) -> Float[Array, "batch 9"]:
        """The same for a batch, with a gradient that is quicker than that of a `vmap`."""
        hidden = observations
        for layer in self.layers[:-1]:
            hidden = jax.nn.relu(_affine(layer.weight, layer.bias, hidden))
        return _affine(self.layers[-1].weight, self.layers[-1].bias, hidden)


@jax.custom_vjp
def _affine(
    weight: Float[Array, "out in"], bias: Float[Array, " out"], inputs: Float[Array, "batch in"]
) -> Float[Array, "batch out"]:
    """A layer for a batch.

    Its gradient transposes before it multiplies: the product over the first axes of both, which differentiation would
    make of it, takes XLA on the CPU a third longer.
    """
    return inputs @ weight.T + bias[None]


def _affine_forward(
    weight: Float[Array, "out in"], bias: Float[Array, " out"], inputs: Float[Array, "batch in"]
) -> tuple[Float[Array, "batch out"], tuple[Float[Array, "out in"], Float[Array, "batch in"]]]:
    return _affine(weight, bias, inputs), (weight, inputs)


def _affine_backward(
    known: tuple[Float[Array, "out in"], Float[Array, "batch in"]], slope: Float[Array, "batch out"]
) -> tuple[Float[Array, "out in"], Float[Array, " out"], Float[Array, "batch in"]]:
    weight, inputs = known
    return jax.lax.optimization_barrier(slope.T) @ inputs, jnp.sum(slope, axis=0), slope @ weight


_affine.defvjp(_affine_forward, _affine_backward)


def make_network(observation: str, width: int, depth: int, key: PRNGKeyArray) -> QNetwork:
    """A network with random weights. The key is consumed.

    Args:
        observation: profile of the observation it reads.
        width: units of each hidden layer.
        depth: number of hidden layers.
    """
    sizes = [OBSERVATION_SIZES[observation], *[width] * depth, NUM_ACTIONS]
    keys = jax.random.split(key, depth + 1)
    layers = tuple(
        eqx.nn.Linear(fan_in, fan_out, key=layer_key)
        for fan_in, fan_out, layer_key in zip(sizes, sizes[1:], keys, strict=False)
    )
    return QNetwork(layers, observation)
