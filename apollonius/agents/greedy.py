"""Players that act by a network's action values: the best action, or now and then a random one."""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.network import QNetwork, inferred
from apollonius.agents.policy import AbstractActionValuePolicy, AbstractPolicy, Memory
from apollonius.agents.uniform import uniform_action
from apollonius.game.chart import Chart
from apollonius.game.types import Scalar
from apollonius.observe.observation import AbstractObservation, Charted, Whole


class Greedy(AbstractActionValuePolicy):
    """The action of highest value; among equals, the lowest index."""

    network: QNetwork
    chart: Chart | None = None
    """Of the arena, for a network that reads one where the game has none."""

    @property
    def observation(self) -> Whole:
        reads = self.network.observation
        return reads if self.chart is None else Charted(reads, self.chart)

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
