"""Players of one side of a batch of games: one player, a pool of several, several next to one
another.
"""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.policy import AbstractPolicy, Memory
from apollonius.game.types import Actions
from apollonius.observe.observation import RAW_VIEW, RawView

Reader = Callable[[Any], Any]
"""From a row of a batch to what players read."""
RowBits = UInt32[Array, " rows"]
"""Random bits for each row of a batch."""
ActionsAndMemory = tuple[Actions, Memory]
"""The action and the next memory in each row of a batch."""


def act_in_rows(
    policy: AbstractPolicy, read: Reader, rows: Any, memory: Memory, bits: RowBits
) -> ActionsAndMemory:
    """Return one player's action and next memory in each row of a batch.

    Args:
        policy: the player.
        read: from a row to the player's observation.
        rows: leaves `[rows, ...]`.
        memory: the player's memory in each row.
        bits: random bits of each row.
    """
    return jax.vmap(lambda row, memory, bits: policy(read(row), memory, bits))(rows, memory, bits)


class AbstractPlayers(eqx.Module):
    """All who play one side of a batch of games; a game meets one member for a whole episode."""

    @property
    @abstractmethod
    def observation(self) -> RawView:
        """The observation of all members."""

    @property
    @abstractmethod
    def memory(self) -> Memory:
        """The memory with which every game begins."""

    @property
    def samples(self) -> bool:
        """True if it takes random bits to draw the member that a game meets."""
        return False

    @abstractmethod
    def sample(self, bits: UInt32[Array, " games"]) -> Int[Array, " games"]:
        """Return the member that each game meets, from the upper half of random bits."""

    @abstractmethod
    def act(
        self, member: Int[Array, " rows"], read: Reader, rows: Any, memory: Memory, bits: RowBits
    ) -> ActionsAndMemory:
        """Return the action and the next memory in each row of a batch.

        Args:
            member: the member that plays each row.
            read: from a row to a player's observation.
            rows: leaves `[rows, ...]`.
            memory: the players' memory in each row.
            bits: random bits of each row.
        """


class Pool(AbstractPlayers):
    """Players that share a structure, stacked.

    Attributes:
        members: a policy whose array leaves have a leading axis of length `size`.
        size: number of members.
        bits: random bits of each game that are used instead of every step's, so that what players
            try can last.
        rest: the policy's leaves that are no arrays, as the functions in a network, which all
            members share.
        weights: shares of games that meet each member, which add up to 1; None for equal ones.
    """

    members: AbstractPolicy
    size: int = eqx.field(static=True, default=1)
    bits: UInt32[Array, " games"] | None = None
    rest: AbstractPolicy | None = eqx.field(static=True, default=None)
    weights: Float[Array, " members"] | None = None

    @property
    def _first(self) -> AbstractPolicy:
        return self._whole(jax.tree.map(lambda leaf: leaf[0], self.members))

    def _whole(self, policy: AbstractPolicy) -> AbstractPolicy:
        return policy if self.rest is None else eqx.combine(policy, self.rest)

    @property
    def observation(self) -> RawView:
        return self._first.observation

    @property
    def memory(self) -> Memory:
        return self._first.memory

    @property
    def samples(self) -> bool:
        return self.size > 1

    def sample(self, bits: UInt32[Array, " games"]) -> Int[Array, " games"]:
        if self.size == 1:
            return jnp.zeros(bits.shape, jnp.int32)
        if self.weights is not None:
            ends = jnp.cumsum(self.weights)[:-1]
            drawn = (bits >> 16).astype(jnp.float32) / 65536
            return jnp.sum(drawn[:, None] >= ends[None], axis=1).astype(jnp.int32)
        return (((bits >> 16) * self.size) >> 16).astype(jnp.int32)

    def act(
        self, member: Int[Array, " rows"], read: Reader, rows: Any, memory: Memory, bits: RowBits
    ) -> ActionsAndMemory:
        bits = bits if self.bits is None else self.bits
        if self.size == 1:
            return act_in_rows(self._first, read, rows, memory, bits)

        def of_member(policy: AbstractPolicy) -> ActionsAndMemory:
            return act_in_rows(self._whole(policy), read, rows, memory, bits)

        def of_own_member(by_member: Array) -> Array:
            index = member.reshape(1, -1, *[1] * (by_member.ndim - 2))
            return jnp.take_along_axis(by_member, index, axis=0)[0]

        return jax.tree.map(of_own_member, jax.vmap(of_member, axis_size=self.size)(self.members))


class PartitionedPlayers(AbstractPlayers):
    """Players of several kinds: each has some games of a batch, the first those in front."""

    policies: tuple[AbstractPolicy, ...]
    games: tuple[int, ...] = eqx.field(static=True)

    @property
    def observation(self) -> RawView:
        """The view, from which each makes its own observation."""
        return RAW_VIEW

    @property
    def memory(self) -> Memory:
        """The memories with which every game begins: that of each player, of which one is used."""
        return tuple(policy.memory for policy in self.policies)

    def sample(self, bits: UInt32[Array, " games"]) -> Int[Array, " games"]:
        return jnp.concatenate(
            [jnp.full(games, number, jnp.int32) for number, games in enumerate(self.games)]
        )

    def act(
        self, member: Int[Array, " rows"], read: Reader, rows: Any, memory: Memory, bits: RowBits
    ) -> ActionsAndMemory:
        actions, after = [], []
        for number, policy in enumerate(self.policies):
            first = sum(self.games[:number])
            rows_of_player = slice(first, first + self.games[number])
            arguments = jax.tree.map(
                lambda leaf, own=rows_of_player: leaf[own], (rows, memory[number], bits)
            )
            action, new = act_in_rows(
                policy, lambda row, policy=policy: policy.observation(read(row)), *arguments
            )
            actions.append(action)
            after.append(
                jax.tree.map(
                    lambda all_rows, own_rows, own=rows_of_player: all_rows.at[own].set(own_rows),
                    memory[number],
                    new,
                )
            )
        return jnp.concatenate(actions), tuple(after)


def single_player(policy: AbstractPolicy) -> Pool:
    """Return one player as the players of a side, as `play_out` and `collect` take them."""
    return stack([policy])


def stack(policies: Sequence[AbstractPolicy]) -> Pool:
    """Return several players of one structure as the players of a side: each game meets one, drawn
    at random.
    """
    arrays, rests = zip(
        *(eqx.partition(policy, eqx.is_array_like) for policy in policies), strict=True
    )
    rest = rests[0] if jax.tree.leaves(rests[0]) else None
    return Pool(jax.tree.map(_stacked, *arrays), len(policies), rest=rest)


def _stacked(*leaves: Any) -> Array:
    """Return leaves along a new first axis; on the host, so that nothing is compiled, but where one
    is traced.
    """
    traced = any(isinstance(leaf, Tracer) for leaf in leaves)
    return jnp.stack(leaves) if traced else jax.device_put(np.stack(leaves))
