"""Players by a network: at its best, or exploring."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.classical import uniform_action
from apollonius.agents.network import GaussianActor, QNetwork, inferred
from apollonius.agents.policy import AbstractActionValuePolicy, AbstractContinuous, AbstractPolicy, Memory
from apollonius.game.chart import Chart
from apollonius.game.types import Scalar
from apollonius.observe.observation import AbstractObservation, Charted, Whole


class AbstractGreedy(AbstractPolicy):
    """A player at its network's best; `chart` is the arena's, for a network that reads one where the game has none."""

    network: eqx.AbstractVar[Any]
    chart: eqx.AbstractVar[Chart | None]

    @property
    def observation(self) -> Whole:
        reads = self.network.observation
        return reads if self.chart is None else Charted(reads, self.chart)


class Greedy(AbstractGreedy, AbstractActionValuePolicy):
    """The action of highest value; among equals, the lowest index."""

    network: QNetwork
    chart: Chart | None = None

    def values(self, seen: Float[Array, " size"]) -> Float[Array, "9"]:
        """Return the network's action values."""
        return inferred(self.network, seen)


class EpsilonGreedy(AbstractPolicy):
    """With probability `epsilon` (to 1.5e-5) a uniformly random action, otherwise the greedy one."""

    network: QNetwork
    epsilon: Scalar

    @property
    def observation(self) -> AbstractObservation:
        return self.network.observation

    def __call__(
        self, seen: Float[Array, " size"], memory: Memory, bits: UInt32[Array, ""]
    ) -> tuple[Int[Array, ""], Memory]:
        best = jnp.argmax(inferred(self.network, seen)).astype(jnp.int32)
        explore = (bits & 0xFFFF).astype(jnp.float32) < self.epsilon * 65536
        return jnp.where(explore, uniform_action(bits), best), memory


class SquashedMean(AbstractGreedy, AbstractContinuous):
    """The hyperbolic tangents of the means: what a trained agent does when it counts."""

    network: GaussianActor
    chart: Chart | None = None

    def __call__(
        self, seen: Float[Array, " size"], memory: Memory, bits: UInt32[Array, ""]
    ) -> tuple[Float[Array, "2"], Memory]:
        return jnp.tanh(self.network(seen)[0]), memory


class SquashedGaussian(AbstractContinuous):
    """Drawn from the distributions, their standard deviations multiplied by `spread`: by 0 it is `SquashedMean`."""

    network: GaussianActor
    spread: Scalar

    @property
    def observation(self) -> AbstractObservation:
        return self.network.observation

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
