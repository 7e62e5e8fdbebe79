"""What every player is: what it reads of its view and random bits in, an action out."""

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt32

from apollonius.game.chart import Chart
from apollonius.game.dynamics import gears
from apollonius.game.types import NUM_ACTIONS, Action, Actions, Scalar
from apollonius.observe.observation import WHOLE, Whole
from apollonius.observe.view import View, each


class AbstractPolicy(eqx.Module):
    """A player of one side. Unbatched; batching is the caller's `vmap`."""

    @property
    def observation(self) -> Whole:
        """What it reads of a view: the view itself, or the numbers that its network does (`apollonius.observe`)."""
        return WHOLE

    @property
    def charted(self) -> bool:
        """Whether it plays by a chart, which a game in several arenas then must have (`apollonius.arenas.charting`)."""
        return self.observation.charted

    @property
    def continuous(self) -> bool:
        """Whether its actions are pairs of gears."""
        return False

    @abstractmethod
    def __call__(self, seen: Any, bits: UInt32[Array, ""]) -> Action:
        """The action for what is seen; always of the same kind.

        Args:
            seen: what the policy's `observation` makes of the view of the robot that it plays.
            bits: 32 random bits, fresh for every step; consumed. Bits instead of a key, since splitting keys for
                thousands of games costs more than the games themselves.
        """

    def together(self, seen: Any, bits: UInt32[Array, " games"]) -> Actions:
        """The actions for what is seen in many games, each its own: a `vmap`, or what is quicker and the same.

        Args:
            seen: `observation.together` of the views.
            bits: random bits for each game.
        """
        return each(self, seen, bits)

    def weigh(self, seen: Any, bits: UInt32[Array, ""]) -> Any:
        """All that `choose` has to know, before it is known which actions are allowed: here the player's own action."""
        return self(seen, bits)

    def weigh_together(self, seen: Any, bits: UInt32[Array, " games"]) -> Any:
        """The same for many games, as in `together`."""
        return self.together(seen, bits)

    def choose(self, weighed: Any, allowed: Bool[Array, "9"]) -> Int[Array, ""]:
        """The discrete action where only some are allowed: the player's own, or else the one of lowest index."""
        return jnp.where(allowed[weighed], weighed, jnp.argmax(allowed)).astype(jnp.int32)


class AbstractActionValuePolicy(AbstractPolicy):
    """A player that values all nine actions and takes the best; among equals, the one of lowest index."""

    @abstractmethod
    def values(self, seen: Any) -> Float[Array, "9"]:
        """The values of the nine actions for what is seen: the higher the better."""

    def __call__(self, seen: Any, bits: UInt32[Array, ""]) -> Int[Array, ""]:
        return jnp.argmax(self.weigh(seen, bits)).astype(jnp.int32)

    def weigh(self, seen: Any, bits: UInt32[Array, ""]) -> Float[Array, "9"]:
        """The values of the nine actions."""
        return self.values(seen)

    def weigh_together(self, seen: Any, bits: UInt32[Array, " games"]) -> Float[Array, "games 9"]:
        """The same for many games."""
        return each(self.weigh, seen, bits)

    def choose(self, weighed: Float[Array, "9"], allowed: Bool[Array, "9"]) -> Int[Array, ""]:
        """The allowed action of highest value."""
        return jnp.argmax(jnp.where(allowed, weighed, -jnp.inf)).astype(jnp.int32)


class AbstractContinuous(AbstractPolicy):
    """A player whose actions are two gears in [-1, 1]."""

    @property
    def continuous(self) -> bool:
        """They are."""
        return True

    @abstractmethod
    def __call__(self, seen: Any, bits: UInt32[Array, ""]) -> Float[Array, "2"]:
        """The two gears for what is seen."""

    def choose(self, weighed: Float[Array, "2"], allowed: Bool[Array, "9"]) -> Int[Array, ""]:
        """The allowed discrete action whose gears are nearest to the player's own."""
        own = gears(weighed)

        def away(action: Int[Array, ""]) -> Scalar:
            gear_u1, gear_u2 = gears(action)
            return (gear_u1 - own[0]) ** 2 + (gear_u2 - own[1]) ** 2

        return jnp.argmin(jnp.where(allowed, jax.vmap(away)(jnp.arange(NUM_ACTIONS)), jnp.inf)).astype(jnp.int32)


def reads_chart(policy: AbstractPolicy) -> bool:
    """Return whether a player reads a chart: the game's, or one that it has with it."""
    leaves = jax.tree.leaves(policy, is_leaf=lambda node: isinstance(node, Chart))
    return policy.charted or any(isinstance(leaf, Chart) for leaf in leaves)


def acts_by_chance(policy: AbstractPolicy, view: View) -> bool:
    """Whether random bits can matter to a player; it is not asked for any action, its program is looked through.

    Args:
        view: any in its game.
    """
    program = jax.make_jaxpr(lambda bits: policy(policy.observation(view), bits))(
        jax.ShapeDtypeStruct((), jnp.uint32)
    ).jaxpr
    (bits,) = program.invars
    read = [variable for equation in program.eqns for variable in equation.invars]
    return any(variable is bits for variable in [*read, *program.outvars])
