"""The interface of all players: an observation, a memory and random bits in, an action and the next
memory out.
"""

from abc import abstractmethod
from typing import Any, Generic, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from apollonius.game.dynamics import action_levels
from apollonius.game.types import NUM_ACTIONS, Action, RandomBits, Scalar
from apollonius.observe.observation import RAW_VIEW, RawView
from apollonius.observe.view import View

Memory = PyTree[Array]
"""State that a player carries from step to step of a game; `()` for one that carries nothing."""


class AbstractPolicy(eqx.Module):
    """A player of one side. Unbatched; batching is the caller's `vmap`."""

    @property
    def observation(self) -> RawView:
        """The part of a view that it reads: all, or the numbers that its network reads
        (`apollonius.observe`).
        """
        return RAW_VIEW

    @property
    def needs_chart(self) -> bool:
        """True if it plays by a chart, which the game then must have
        (`apollonius.arenas.charting`).
        """
        return self.observation.needs_chart

    @property
    def continuous(self) -> bool:
        """True if its actions are pairs of levels."""
        return False

    @property
    def memory(self) -> Memory:
        """The memory with which every game begins."""
        return ()

    @abstractmethod
    def __call__(
        self, observation: Any, /, memory: Memory, bits: RandomBits
    ) -> tuple[Action, Memory]:
        """Choose an action, always of the same kind.

        The memory is what it returned in the step before, in a game's first step its own. There are
        32 random bits for every step instead of a key, since splitting keys for thousands of games
        costs more than the games themselves.
        """

    def score(self, observation: Any, /, memory: Memory, bits: RandomBits) -> tuple[Any, Memory]:
        """Return all that `select` needs before it is known which actions are allowed: here the
        player's own action.
        """
        return self(observation, memory, bits)

    def select(self, scores: Any, allowed: Bool[Array, "9"]) -> Int[Array, ""]:
        """Return the player's own discrete action if it is allowed, else the allowed one of lowest
        index.
        """
        return jnp.where(allowed[scores], scores, jnp.argmax(allowed)).astype(jnp.int32)


class AbstractActionValuePolicy(AbstractPolicy):
    """A player that values all nine actions and takes the best; among equals, the one of lowest
    index.
    """

    @abstractmethod
    def values(self, observation: Any, /) -> Float[Array, "9"]:
        """Return the values of the nine actions: the higher the better."""

    def __call__(
        self, observation: Any, /, memory: Memory, bits: RandomBits
    ) -> tuple[Int[Array, ""], Memory]:
        values, memory = self.score(observation, memory, bits)
        return jnp.argmax(values).astype(jnp.int32), memory

    def score(
        self, observation: Any, /, memory: Memory, bits: RandomBits
    ) -> tuple[Float[Array, "9"], Memory]:
        """Return the values of the nine actions."""
        return self.values(observation), memory

    def select(self, scores: Float[Array, "9"], allowed: Bool[Array, "9"]) -> Int[Array, ""]:
        """Return the allowed action of highest value."""
        return jnp.argmax(jnp.where(allowed, scores, -jnp.inf)).astype(jnp.int32)


Inner = TypeVar("Inner", bound=AbstractPolicy)
"""Kind of the player within a wrapper."""


class AbstractWrapper(AbstractPolicy, Generic[Inner]):
    """A player around another one, with its memory and its kind of actions.

    It reads what the other one reads or, for `score_view`, the whole view.
    """

    policy: Inner

    @property
    def needs_chart(self) -> bool:
        return self.policy.needs_chart

    @property
    def continuous(self) -> bool:
        return self.policy.continuous

    @property
    def memory(self) -> Memory:
        return self.policy.memory

    def score_view(self, view: View, memory: Memory, bits: RandomBits) -> tuple[Any, Memory]:
        """Score a view by the other player, whose memory this is."""
        return self.policy.score(self.policy.observation(view), memory, bits)


class AbstractValueWrapper(AbstractWrapper[AbstractActionValuePolicy], AbstractActionValuePolicy):
    """A player around one that values the nine actions, whose `score` changes the view or the
    values.
    """

    def values(self, observation: Any, /) -> Float[Array, "9"]:
        """Return the values of the nine actions in a game's first step."""
        return self.score(observation, self.memory, jnp.uint32(0))[0]

    @abstractmethod
    def score(
        self, observation: Any, /, memory: Memory, bits: RandomBits
    ) -> tuple[Float[Array, "9"], Memory]:
        """Return the values of the nine actions."""


class AbstractContinuous(AbstractPolicy):
    """A player whose actions are two levels in [-1, 1]."""

    @property
    def continuous(self) -> bool:
        return True

    def select(self, scores: Float[Array, "2"], allowed: Bool[Array, "9"]) -> Int[Array, ""]:
        """Return the allowed discrete action whose levels are nearest to the player's own."""
        own = action_levels(scores)

        def distance(action: Int[Array, ""]) -> Scalar:
            level_u1, level_u2 = action_levels(action)
            return (level_u1 - own[0]) ** 2 + (level_u2 - own[1]) ** 2

        return jnp.argmin(
            jnp.where(allowed, jax.vmap(distance)(jnp.arange(NUM_ACTIONS)), jnp.inf)
        ).astype(jnp.int32)
