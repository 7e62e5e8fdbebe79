"""The player that acts uniformly at random (the paper's random evader)."""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.policy import AbstractPolicy
from apollonius.game.types import NUM_ACTIONS


def uniform_action(word: UInt32[Array, ""]) -> Int[Array, ""]:
    """One of the 9 actions from the upper 16 bits of a random word, uniform to 1.5e-5."""
    return (((word >> 16) * NUM_ACTIONS) >> 16).astype(jnp.int32)


class Uniform(AbstractPolicy):
    """Each of the 9 actions with equal probability at every step (section V-B of the paper)."""

    @property
    def observation(self) -> str:
        """It does not look; the paper's observation is the cheapest."""
        return "paper"

    def __call__(self, observation: Float[Array, " size"], word: UInt32[Array, ""]) -> Int[Array, ""]:
        return uniform_action(word)
