"""The player that draws its actions while it learns by proximal policy optimisation."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.agents.network import QNetwork, inferred
from apollonius.agents.trained import AbstractByNetwork
from apollonius.game.types import Bits
from apollonius.learn.caution import costs


class Drawing(AbstractByNetwork):
    """The action drawn by a network's values as logits, less the costs of missing clearance.

    The random number that chooses it is held for some steps: each action keeps its probability, and what is tried lasts
    long enough to lead somewhere (Hollenstein, Martius and Piater, "Colored noise in PPO", 2024).

    Attributes:
        wanted: clearance after braking [m], or 0.
        price: what a lost game costs in the values.
        hold: steps for which a number is held, on average.
    """

    network: QNetwork
    wanted: float = eqx.field(static=True)
    price: float = eqx.field(static=True)
    hold: float = eqx.field(static=True)

    @property
    def memory(self) -> Bits:
        """The number that is held; 0 where none is."""
        return jnp.zeros((), jnp.uint32)

    def __call__(
        self, observation: Float[Array, " size"], memory: Bits, bits: Bits
    ) -> tuple[Int[Array, ""], Bits]:
        below = jnp.cumsum(
            jax.nn.softmax(self.less_costs(inferred(self.network, observation), observation))
        )
        lasts = ((bits & 0xFF).astype(jnp.float32) >= 256 / self.hold) & (memory > 0)
        held = jnp.where(lasts, memory, bits)
        drawn = (held >> 8).astype(jnp.float32) / 2**24
        return jnp.minimum(jnp.sum(drawn >= below), below.size - 1).astype(jnp.int32), held

    def log_probabilities(self, observations: Float[Array, "rows size"]) -> Float[Array, "rows 9"]:
        return jax.nn.log_softmax(self.less_costs(self.network.batch(observations), observations))

    def less_costs(
        self, values: Float[Array, "*rows 9"], observations: Float[Array, "*rows size"]
    ) -> Array:
        return values - costs(observations, self.wanted, self.price) if self.wanted else values
