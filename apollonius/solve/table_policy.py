"""The player that acts by a solved table."""

from jaxtyping import Array, Float

from apollonius.agents.policy import AbstractValued
from apollonius.game.observation import own_state
from apollonius.solve.reach import Reach


class TablePolicy(AbstractValued):
    """The pursuer that catches a target standing still in the least time; it decides anew in every step."""

    reach: Reach

    @property
    def observation(self) -> str:
        """The profile that tells the robot's own state with the least arithmetic."""
        return "paper"

    def values(self, observation: Float[Array, " size"]) -> Float[Array, "9"]:
        """What the nine actions are worth."""
        motion = self.reach.motion
        return self.reach.action_values(own_state(self.observation, motion.arena, motion.body, observation))
