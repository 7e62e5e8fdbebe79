"""The action-value network (Fig. 3): an observation in, one value per action out."""

import equinox as eqx
import jax
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
