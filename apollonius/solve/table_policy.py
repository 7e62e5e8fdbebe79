"""The player that acts by a solved table."""

from jaxtyping import Array, Float

from apollonius.agents.policy import AbstractActionValuePolicy
from apollonius.observe.view import View
from apollonius.solve.reach import Reach


class TablePolicy(AbstractActionValuePolicy):
    """The pursuer that catches a target standing still in the least time; it decides anew in every step."""

    reach: Reach

    def values(self, seen: View) -> Float[Array, "9"]:
        """What the nine actions are worth."""
        return self.reach.action_values(seen.own.state)
