"""The player that draws its actions while it learns by proximal policy optimisation."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.agents.network import QNetwork
from apollonius.agents.trained import AbstractByNetwork
from apollonius.game.types import RandomBits
from apollonius.learn.clearance_penalty import clearance_penalty


class SamplingPolicy(AbstractByNetwork):
    """The action drawn by a network's values as logits, less the costs of missing clearance.

    The random number that chooses it is held for some steps: each action keeps its probability, and
    what is tried lasts long enough to lead somewhere (Hollenstein, Martius and Piater, "Colored
    noise in PPO", 2024).

    Attributes:
        clearance_margin: clearance after braking [m], or 0.
        loss_value: what a lost game costs in the values.
        hold: steps for which a number is held, on average.
    """

    network: QNetwork
    clearance_margin: float = eqx.field(static=True)
    loss_value: float = eqx.field(static=True)
    hold: float = eqx.field(static=True)

    @property
    def memory(self) -> RandomBits:
        """The number that is held; 0 where none is."""
        return jnp.zeros((), jnp.uint32)

    def __call__(
        self, observation: Float[Array, " size"], noise_memory: RandomBits, bits: RandomBits
    ) -> tuple[Int[Array, ""], RandomBits]:
        below = jnp.cumsum(jax.nn.softmax(self.penalise(self.network(observation), observation)))
        lasts = ((bits & 0xFF).astype(jnp.float32) >= 256 / self.hold) & (noise_memory > 0)
        action_bits = jnp.where(lasts, noise_memory, bits)
        drawn = (action_bits >> 8).astype(jnp.float32) / 2**24
        return jnp.minimum(jnp.sum(drawn >= below), below.size - 1).astype(jnp.int32), action_bits

    def log_probabilities(self, observations: Float[Array, "rows size"]) -> Float[Array, "rows 9"]:
        return jax.nn.log_softmax(self.penalise(self.network.batch(observations), observations))

    def penalise(
        self, values: Float[Array, "*rows 9"], observations: Float[Array, "*rows size"]
    ) -> Array:
        return (
            values - clearance_penalty(observations, self.clearance_margin, self.loss_value)
            if self.clearance_margin
            else values
        )
