"""Who plays one side of a batch of games: one player, a pool of several, earlier versions in seats."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.policy import AbstractPolicy
from apollonius.game.types import Actions
from apollonius.observe.observation import Whole


class Pool(eqx.Module):
    """Players of one side that share a structure, stacked; a game meets one of them, for a whole episode.

    Attributes:
        members: a policy whose array leaves have a leading axis of length `size`.
        size: number of members.
    """

    members: AbstractPolicy
    size: int = eqx.field(static=True, default=1)

    @property
    def observation(self) -> Whole:
        """What all members read of a view."""
        return self._first.observation

    @property
    def _first(self) -> AbstractPolicy:
        return jax.tree.map(lambda leaf: leaf[0], self.members)

    @property
    def samples(self) -> bool:
        """Whether it takes random bits to say who plays a game."""
        return self.size > 1

    def sample(self, bits: UInt32[Array, " games"]) -> Int[Array, " games"]:
        """The member that each game meets, from the upper half of random bits."""
        if self.size == 1:
            return jnp.zeros(bits.shape, jnp.int32)
        return (((bits >> 16) * self.size) >> 16).astype(jnp.int32)

    def act(
        self,
        member: Int[Array, " games"],
        seen: Any,
        bits: UInt32[Array, " games"],
    ) -> Actions:
        """Each game's action, by the member of this pool that it meets."""
        if self.size == 1:
            return self._first.together(seen, bits)
        everyone = jax.vmap(lambda policy: policy.together(seen, bits), axis_size=self.size)(self.members)
        theirs = member.reshape(1, -1, *[1] * (everyone.ndim - 2))
        return jnp.take_along_axis(everyone, theirs, axis=0)[0]


class Seated(eqx.Module):
    """One player for most games of a batch, and others who each have a few games of their own, next to one another.

    A batch meets many players and takes no more arithmetic than with one. Member 0 is the player at large, members 1,
    2, ... are those in the seats.

    Attributes:
        at_large: the player of all games without a seat.
        seated: the others; array leaves have a leading axis of length `seats`.
        seats: how many they are.
        first: the first game that belongs to a seat.
        games: how many games belong to each.
    """

    at_large: AbstractPolicy
    seated: AbstractPolicy
    seats: int = eqx.field(static=True)
    first: int = eqx.field(static=True)
    games: int = eqx.field(static=True)

    @property
    def observation(self) -> Whole:
        """What all of them read of a view."""
        return self.at_large.observation

    @property
    def samples(self) -> bool:
        """Whether it takes random bits to say who plays a game: seats are fixed."""
        return False

    def sample(self, bits: UInt32[Array, " games"]) -> Int[Array, " games"]:
        """The member that each game meets."""
        game = jnp.arange(bits.shape[0]) - self.first
        return jnp.where((game >= 0) & (game < self.seats * self.games), game // self.games + 1, 0).astype(jnp.int32)

    def act(
        self,
        member: Int[Array, " games"],
        seen: Float[Array, "games size"],
        bits: UInt32[Array, " games"],
    ) -> Actions:
        """Each game's action, by the player whose it is."""
        end = self.first + self.seats * self.games
        seats = (self.seats, self.games)
        others = jax.vmap(lambda policy, *given: jax.vmap(policy)(*given))(
            self.seated,
            seen[self.first : end].reshape(*seats, -1),
            bits[self.first : end].reshape(seats),
        )
        beside = [jnp.concatenate([leaf[: self.first], leaf[end:]]) for leaf in (seen, bits)]
        own = jax.vmap(self.at_large)(*beside)
        return jnp.concatenate([own[: self.first], others.reshape(-1, *others.shape[2:]), own[self.first :]])


class PersistentNoise(eqx.Module):
    """Players who are given random bits of their own instead of every step's, so that what they try can last.

    Attributes:
        players: whoever they are.
        bits: some for each game.
    """

    players: Pool | Seated
    bits: UInt32[Array, " games"]

    @property
    def observation(self) -> Whole:
        """What all of them read of a view."""
        return self.players.observation

    @property
    def samples(self) -> bool:
        """Whether it takes random bits to say who plays a game."""
        return self.players.samples

    def sample(self, bits: UInt32[Array, " games"]) -> Int[Array, " games"]:
        """The member that each game meets."""
        return self.players.sample(bits)

    def act(
        self,
        member: Int[Array, " games"],
        seen: Any,
        bits: UInt32[Array, " games"],
    ) -> Actions:
        """Each game's action, by its own bits."""
        return self.players.act(member, seen, self.bits)


def solo(policy: AbstractPolicy) -> Pool:
    """The pool of just this player."""
    return Pool(jax.tree.map(_alone, policy))


def _alone(leaf: Any) -> Any:
    """An array with one more axis in front; on the host, so that nothing is compiled, but where it is traced."""
    return jnp.asarray(leaf)[None] if isinstance(leaf, Tracer) else jax.device_put(_on_host(leaf)[None])


def _on_host(leaf: Any) -> np.ndarray:
    array = np.asarray(leaf)
    return array.astype(jax.dtypes.canonicalize_dtype(array.dtype))


def stack(policies: list[AbstractPolicy]) -> Pool:
    """The pool of these players, which must have one structure."""
    return Pool(jax.tree.map(lambda *leaves: jnp.stack(leaves), *policies), len(policies))
