"""Players that follow a rule instead of a network."""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.policy import AbstractPolicy

BRAKE_STRAIGHT = 1
"""Index of the action (u1 = -u1_max, u2 = 0)."""


class Still(AbstractPolicy):
    """Brakes straight ahead and then stays: the stationary evader of stage 1 (Algorithm 1)."""

    @property
    def observation(self) -> str:
        """It does not look; the paper's observation is the cheapest."""
        return "paper"

    def __call__(self, observation: Float[Array, " size"], word: UInt32[Array, ""]) -> Int[Array, ""]:
        return jnp.full((), BRAKE_STRAIGHT, jnp.int32)
