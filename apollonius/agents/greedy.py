"""Players by a network: at its best, or exploring."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.classical import uniform_action
from apollonius.agents.network import GaussianActor, QNetwork, inferred
from apollonius.agents.policy import AbstractActionValuePolicy, AbstractContinuous, AbstractPolicy, Memory
from apollonius.game.types import Scalar
from apollonius.observe.observation import AbstractObservation


class AbstractByNetwork(AbstractPolicy):
    """A player by a network, which reads that network's observation."""

    network: eqx.AbstractVar[Any]

    @property
    def observation(self) -> AbstractObservation:
        return self.network.observation


class Greedy(AbstractByNetwork, AbstractActionValuePolicy):
    """The action of highest value; among equals, the lowest index."""

    network: QNetwork

    def values(self, seen: Float[Array, " size"]) -> Float[Array, "9"]:
        """Return the network's action values."""
        return inferred(self.network, seen)


class EpsilonGreedy(AbstractByNetwork):
    """With probability `epsilon` (to 1.5e-5) a uniformly random action, otherwise the greedy one."""

    network: QNetwork
    epsilon: Scalar

    def __call__(
        self, seen: Float[Array, " size"], memory: Memory, bits: UInt32[Array, ""]
    ) -> tuple[Int[Array, ""], Memory]:
        best = jnp.argmax(inferred(self.network, seen)).astype(jnp.int32)
        explore = (bits & 0xFFFF).astype(jnp.float32) < self.epsilon * 65536
        return jnp.where(explore, uniform_action(bits), best), memory


class SquashedMean(AbstractByNetwork, AbstractContinuous):
    """The hyperbolic tangents of the means: what a trained agent does when it counts."""

    network: GaussianActor

    def __call__(
        self, seen: Float[Array, " size"], memory: Memory, bits: UInt32[Array, ""]
    ) -> tuple[Float[Array, "2"], Memory]:
        return jnp.tanh(self.network(seen)[0]), memory


class SquashedGaussian(AbstractByNetwork, AbstractContinuous):
    """Drawn from the distributions, their standard deviations multiplied by `spread`: by 0 it is `SquashedMean`."""

    network: GaussianActor
    spread: Scalar

    def __call__(
        self, seen: Float[Array, " size"], memory: Memory, bits: UInt32[Array, ""]
    ) -> tuple[Float[Array, "2"], Memory]:
        mean, deviation = inferred(self.network, seen)
        return jnp.tanh(mean + self.spread * deviation * normal_pair(bits)), memory


def normal_pair(bits: UInt32[Array, ""]) -> Float[Array, "2"]:
    """Return two independent standard normal numbers from the halves of random bits (Box and Muller, 1958).

    The upper half says how far, the lower half where to; none is beyond 4.9.
    """
    upper, lower = ((half.astype(jnp.float32) + 0.5) / 65536 for half in (bits >> 16, bits & 0xFFFF))
    radius, angle = jnp.sqrt(-2 * jnp.log(upper)), 2 * jnp.pi * lower
    return radius * jnp.stack([jnp.cos(angle), jnp.sin(angle)])
