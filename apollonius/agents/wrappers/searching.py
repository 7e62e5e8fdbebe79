"""A pursuer that searches: in the view of another one, an opponent out of sight is where it can
be.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.agents.path_following import NOWHERE, random_shares, search_view
from apollonius.agents.policy import AbstractValueWrapper, Memory
from apollonius.game.types import RandomBits
from apollonius.observe.view import View


class Searching(AbstractValueWrapper):
    """Another pursuer, which hunts for its opponent at the places of `Search` while it does not see
    it.

    It drives there as it drives to an opponent, so it keeps what it knows of walls, its body and
    its drive.
    """

    @property
    def needs_chart(self) -> bool:
        return True

    @property
    def memory(self) -> tuple[Memory, Int[Array, ""]]:
        """The memory of the pursuer, and the coarse cell that it drives to; -1 for none."""
        return self.policy.memory, jnp.full((), NOWHERE, jnp.int32)

    def score(
        self, view: View, memory: tuple[Memory, Int[Array, ""]], bits: RandomBits
    ) -> tuple[Float[Array, "9"], Memory]:
        sought, cell = search_view(view, memory[1], random_shares(bits, view.chart))
        values, own_memory = self.score_view(sought, memory[0], bits)
        return values, (own_memory, cell)
