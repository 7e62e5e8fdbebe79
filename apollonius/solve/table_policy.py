"""The player that acts by a solved table."""

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt32

from apollonius.agents.policy import AbstractPolicy
from apollonius.game.observation import own_state
from apollonius.solve.reach import Reach


class TablePolicy(AbstractPolicy):
    """The pursuer that catches a target standing still in the least time; it decides anew in every step."""

    reach: Reach

    @property
    def observation(self) -> str:
        """The profile that tells the robot's own state with the least arithmetic."""
        return "paper"

    def __call__(self, observation: Float[Array, " size"], word: UInt32[Array, ""]) -> Int[Array, ""]:
        return self.act_among(jnp.ones(9, bool), observation, word)

    def act_among(
        self, allowed: Bool[Array, "9"], observation: Float[Array, " size"], word: UInt32[Array, ""]
    ) -> Int[Array, ""]:
        """The allowed action that is worth most."""
        motion = self.reach.motion
        values = self.reach.action_values(own_state(self.observation, motion.arena, motion.body, observation))
        return jnp.argmax(jnp.where(allowed, values, -jnp.inf)).astype(jnp.int32)
