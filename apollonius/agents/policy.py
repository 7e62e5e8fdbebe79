"""What every player is: an observation and a random word in, an action out."""

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
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
