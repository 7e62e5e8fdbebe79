"""What every player is: an observation and a random word in, an action out."""

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float, Int, UInt32

from apollonius.game.dynamics import gears, is_continuous
from apollonius.game.observation import OBSERVATION_SIZES
from apollonius.game.types import NUM_ACTIONS, Action, Actions, Scalar


class AbstractPolicy(eqx.Module):
    """A player of one side. Unbatched; batching is the caller's `vmap`."""

    @property
    @abstractmethod
    def observation(self) -> str:
        """Profile of the observation it expects (`apollonius.game.observation`)."""

    @abstractmethod
    def __call__(self, observation: Float[Array, " size"], word: UInt32[Array, ""]) -> Action:
        """The action for an observation; always of the same kind.

        Args:
            observation: what the player's side sees, in the policy's profile.
            word: 32 random bits, fresh for every step; consumed. One word instead of a key, since splitting keys for
                thousands of games costs more than the games themselves.
        """

    def together(self, observations: Float[Array, "games size"], words: UInt32[Array, " games"]) -> Actions:
        """The actions for the observations of many games, each its own: a `vmap`, or what is quicker and the same."""
        return jax.vmap(self)(observations, words)

    def weigh(self, observation: Float[Array, " size"], word: UInt32[Array, ""]) -> Any:
        """All that `choose` has to know, before it is known which actions are allowed: here the player's own action."""
        return self(observation, word)

    def weigh_together(self, observations: Float[Array, "games size"], words: UInt32[Array, " games"]) -> Any:
        """The same for the observations of many games, as in `together`."""
        return self.together(observations, words)

    def choose(self, weighed: Any, allowed: Bool[Array, "9"]) -> Int[Array, ""]:
        """The discrete action where only some are allowed: the player's own, or else the one of lowest index."""
        return jnp.where(allowed[weighed], weighed, jnp.argmax(allowed)).astype(jnp.int32)

    def act_among(
        self, allowed: Bool[Array, "9"], observation: Float[Array, " size"], word: UInt32[Array, ""]
    ) -> Int[Array, ""]:
        """The discrete action for an observation where only some are allowed; the player's own if that is."""
        return self.choose(self.weigh(observation, word), allowed)


class AbstractValued(AbstractPolicy):
    """A player that values all nine actions and takes the best; among equals, the one of lowest index."""

    @abstractmethod
    def values(self, observation: Float[Array, " size"]) -> Float[Array, "9"]:
        """The values of the nine actions for an observation in the policy's profile: the higher the better."""

    def __call__(self, observation: Float[Array, " size"], word: UInt32[Array, ""]) -> Int[Array, ""]:
        return jnp.argmax(self.weigh(observation, word)).astype(jnp.int32)

    def weigh(self, observation: Float[Array, " size"], word: UInt32[Array, ""]) -> Float[Array, "9"]:
        """The values of the nine actions."""
        return self.values(observation)

    def weigh_together(
        self, observations: Float[Array, "games size"], words: UInt32[Array, " games"]
    ) -> Float[Array, "games 9"]:
        """The same for the observations of many games."""
        return jax.vmap(self.weigh)(observations, words)

    def choose(self, weighed: Float[Array, "9"], allowed: Bool[Array, "9"]) -> Int[Array, ""]:
        """The allowed action of highest value."""
        return jnp.argmax(jnp.where(allowed, weighed, -jnp.inf)).astype(jnp.int32)


class AbstractContinuous(AbstractPolicy):
    """A player whose actions are two gears in [-1, 1]."""

    @abstractmethod
    def __call__(self, observation: Float[Array, " size"], word: UInt32[Array, ""]) -> Float[Array, "2"]:
        """The two gears for an observation."""

    def choose(self, weighed: Float[Array, "2"], allowed: Bool[Array, "9"]) -> Int[Array, ""]:
        """The allowed discrete action whose gears are nearest to the player's own."""
        own = gears(weighed)

        def away(action: Int[Array, ""]) -> Scalar:
            gear_u1, gear_u2 = gears(action)
            return (gear_u1 - own[0]) ** 2 + (gear_u2 - own[1]) ** 2

        return jnp.argmin(jnp.where(allowed, jax.vmap(away)(jnp.arange(NUM_ACTIONS)), jnp.inf)).astype(jnp.int32)


def acts_continuously(policy: AbstractPolicy) -> bool:
    """Whether a player's actions are pairs of gears; it is not asked for any."""
    seen = jax.ShapeDtypeStruct((OBSERVATION_SIZES[policy.observation],), jnp.float32)
    return is_continuous(eqx.filter_eval_shape(policy, seen, jax.ShapeDtypeStruct((), jnp.uint32)))


def acts_by_chance(policy: AbstractPolicy) -> bool:
    """Whether the random word can matter to a player; it is not asked for any action, its program is looked through."""
    seen = jax.ShapeDtypeStruct((OBSERVATION_SIZES[policy.observation],), jnp.float32)
    program = jax.make_jaxpr(policy)(seen, jax.ShapeDtypeStruct((), jnp.uint32)).jaxpr
    word = program.invars[1]
    read = [variable for equation in program.eqns for variable in equation.invars]
    return any(variable is word for variable in [*read, *program.outvars])


class Pool(eqx.Module):
    """Players of one side that share a structure, stacked; a game meets one of them, for a whole episode.

    Attributes:
        members: a policy whose array leaves have a leading axis of length `size`.
        size: number of members.
    """

    members: AbstractPolicy
    size: int = eqx.field(static=True, default=1)

    @property
    def observation(self) -> str:
        """Profile of the observation that all members expect."""
        return self.members.observation

    @property
    def draws(self) -> bool:
        """Whether it takes random words to say who plays a game."""
        return self.size > 1

    def draw(self, words: UInt32[Array, " games"]) -> Int[Array, " games"]:
        """The member that each game meets, from the upper bits of random words."""
        if self.size == 1:
            return jnp.zeros(words.shape, jnp.int32)
        return (((words >> 16) * self.size) >> 16).astype(jnp.int32)

    def act(
        self,
        member: Int[Array, " games"],
        observation: Float[Array, "games size"],
        word: UInt32[Array, " games"],
    ) -> Actions:
        """Each game's action, by the member of this pool that it meets."""
        if self.size == 1:
            return jax.tree.map(lambda leaf: leaf[0], self.members).together(observation, word)
        everyone = jax.vmap(lambda policy: policy.together(observation, word), axis_size=self.size)(self.members)
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
    def observation(self) -> str:
        """Profile of the observation that all of them expect."""
        return self.at_large.observation

    @property
    def draws(self) -> bool:
        """Whether it takes random words to say who plays a game: seats are fixed."""
        return False

    def draw(self, words: UInt32[Array, " games"]) -> Int[Array, " games"]:
        """The member that each game meets."""
        game = jnp.arange(words.shape[0]) - self.first
        return jnp.where((game >= 0) & (game < self.seats * self.games), game // self.games + 1, 0).astype(jnp.int32)

    def act(
        self,
        member: Int[Array, " games"],
        observation: Float[Array, "games size"],
        word: UInt32[Array, " games"],
    ) -> Actions:
        """Each game's action, by the player whose it is."""
        end = self.first + self.seats * self.games
        seats = (self.seats, self.games)
        others = jax.vmap(lambda policy, seen, words: jax.vmap(policy)(seen, words))(
            self.seated,
            observation[self.first : end].reshape(*seats, -1),
            word[self.first : end].reshape(seats),
        )
        beside = [jnp.concatenate([leaf[: self.first], leaf[end:]]) for leaf in (observation, word)]
        own = jax.vmap(self.at_large)(*beside)
        return jnp.concatenate([own[: self.first], others.reshape(-1, *others.shape[2:]), own[self.first :]])


class Held(eqx.Module):
    """Players who are given random words of their own instead of every step's, so that what they try can last.

    Attributes:
        players: whoever they are.
        words: one for each game.
    """

    players: Pool | Seated
    words: UInt32[Array, " games"]

    @property
    def observation(self) -> str:
        """Profile of the observation that all of them expect."""
        return self.players.observation

    @property
    def draws(self) -> bool:
        """Whether it takes random words to say who plays a game."""
        return self.players.draws

    def draw(self, words: UInt32[Array, " games"]) -> Int[Array, " games"]:
        """The member that each game meets."""
        return self.players.draw(words)

    def act(
        self,
        member: Int[Array, " games"],
        observation: Float[Array, "games size"],
        word: UInt32[Array, " games"],
    ) -> Actions:
        """Each game's action, by its own word."""
        return self.players.act(member, observation, self.words)


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
