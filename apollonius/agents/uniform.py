"""The player that acts uniformly at random (the paper's random evader)."""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.policy import AbstractPolicy, Memory
from apollonius.game.types import NUM_ACTIONS
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.paper import PAPER


def uniform_action(bits: UInt32[Array, ""]) -> Int[Array, ""]:
    """Return one of the 9 actions from the upper half of random bits, uniform to 1.5e-5."""
    return (((bits >> 16) * NUM_ACTIONS) >> 16).astype(jnp.int32)


class Uniform(AbstractPolicy):
    """Each of the 9 actions with equal probability at every step (section V-B of the paper)."""

    @property
    def observation(self) -> AbstractObservation:
        """The paper's observation, for those who collect its transitions; it does not look."""
        return PAPER

    def __call__(
        self, seen: Float[Array, " size"], memory: Memory, bits: UInt32[Array, ""]
    ) -> tuple[Int[Array, ""], Memory]:
        return uniform_action(bits), memory
