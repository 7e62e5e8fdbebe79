"""Players that act by a distribution over pairs of gears: its middle, or drawn from it."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, UInt32

from apollonius.agents.network import GaussianActor
from apollonius.agents.policy import AbstractContinuous
from apollonius.game.chart import Chart
from apollonius.game.types import Scalar
from apollonius.observe.charted import Charted
from apollonius.observe.observation import AbstractObservation, Whole


class SquashedMean(AbstractContinuous):
    """The hyperbolic tangents of the means: what a trained agent does when it counts."""

    network: GaussianActor
    chart: Chart | None = None
    """Of the arena, for a network that reads one where the game has none."""

    @property
    def observation(self) -> Whole:
        """What the network reads."""
        reads = self.network.observation
        return reads if self.chart is None else Charted(reads, self.chart)

    def __call__(self, seen: Float[Array, " size"], bits: UInt32[Array, ""]) -> Float[Array, "2"]:
        return jnp.tanh(self.network(seen)[0])


class SquashedGaussian(AbstractContinuous):
    """Drawn from the distributions, their standard deviations multiplied by `spread`: by 0 it is `SquashedMean`."""

    network: GaussianActor
    spread: Scalar

    @property
    def observation(self) -> AbstractObservation:
        """What the network reads."""
        return self.network.observation

    def __call__(self, seen: Float[Array, " size"], bits: UInt32[Array, ""]) -> Float[Array, "2"]:
        return self._sample(*self.network(seen), bits)

    def together(self, seen: Float[Array, "games size"], bits: UInt32[Array, " games"]) -> Float[Array, "games 2"]:
        """The two gears for each observation."""
        return jax.vmap(self._sample)(*self.network.together(seen), bits)

    def _sample(
        self, mean: Float[Array, "2"], deviation: Float[Array, "2"], bits: UInt32[Array, ""]
    ) -> Float[Array, "2"]:
        return jnp.tanh(mean + self.spread * deviation * normal_pair(bits))


def normal_pair(bits: UInt32[Array, ""]) -> Float[Array, "2"]:
    """Two independent standard normal numbers from the halves of random bits (Box and Muller, 1958).

    The upper half says how far, the lower half where to; none is beyond 4.9.
    """
    upper, lower = ((half.astype(jnp.float32) + 0.5) / 65536 for half in (bits >> 16, bits & 0xFFFF))
    radius, angle = jnp.sqrt(-2 * jnp.log(upper)), 2 * jnp.pi * lower
    return radius * jnp.stack([jnp.cos(angle), jnp.sin(angle)])
