"""Players of the two-robot game that act by a solved table: they look one hold ahead, again in every step."""

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Shaped, UInt32

from apollonius.agents.batching import batched_by, spread
from apollonius.agents.policy import AbstractActionValuePolicy, Memory
from apollonius.game.types import GameState, Outcome, RobotState, Role
from apollonius.observe.view import View
from apollonius.solve.joint import interpolate
from apollonius.solve.motion import every_hold, last
from apollonius.solve.zero_sum_game import ZeroSumGame, first_events


class AbstractSearch(AbstractActionValuePolicy):
    """A player that holds each of its actions by the rules and judges by what comes after.

    Attributes:
        zero_sum_game: the game, from its side.
    """

    zero_sum_game: ZeroSumGame

    def values(self, seen: View) -> Float[Array, "9"]:
        return self.weigh(seen, (), jnp.zeros((), jnp.uint32))[0]

    def weigh(self, seen: View, memory: Memory, bits: UInt32[Array, ""]) -> tuple[Float[Array, "9"], Memory]:
        """Return the values against an opponent that acts by chance, as by these bits."""
        return _values_in_one(self, seen.own.state, seen.opponent.state, bits), memory

    def best_value(self, states: GameState) -> Float[Array, " games"]:
        """Estimate what its side is sure of in several states of the game, leaves `[games]`."""
        return _best_values(self, states)

    @abstractmethod
    def action_values(
        self, own: RobotState, other: RobotState, bits: UInt32[Array, " games"]
    ) -> Float[Array, "9 games"]:
        """Return the values of the nine actions in several games at once.

        Args:
            own, other: the robots, leaves `[games]`.
            bits: random bits for each game, which a search against an opponent that acts by chance uses.
        """


def _values_in_many(size: int, batched: Any, player: AbstractSearch, *seen: Any) -> Float[Array, "games 9"]:
    return player.action_values(*spread(size, tuple(batched[1:]), seen)).T


@batched_by(_values_in_many)
def _values_in_one(
    player: AbstractSearch, own: RobotState, other: RobotState, bits: UInt32[Array, ""]
) -> Float[Array, "9"]:
    """Return the values of the nine actions in one game; a batch of games is looked at together."""
    alone = jax.tree.map(lambda leaf: leaf[None], (own, other, bits))
    return player.action_values(*alone)[:, 0]


class SaddlePolicy(AbstractSearch):
    """The player of either side that makes most of what it can be sure of (`guarantee`).

    Attributes:
        table: that of `solve_duel`: what its side is sure of once it has moved; between nodes an estimate.
    """

    table: Shaped[Array, "tiles moving lanes"]

    def action_values(
        self, own: RobotState, other: RobotState, bits: UInt32[Array, " games"]
    ) -> Float[Array, "9 games"]:
        """Return the value of each action against the answer that is worst for it.

        An answer counts by the rules where it ends the game within the hold, and by the table otherwise.
        """
        game, (grid, other_grid) = self.zero_sum_game, self.zero_sum_game.grids
        mine, theirs = (every_hold(motion, robot) for motion, robot in zip(game.motions, (own, other), strict=True))
        outcome, seconds = first_events(game.game, *game.pair(mine, theirs))
        if game.role == Role.EVADER:
            outcome, seconds = jnp.swapaxes(outcome, 0, 1), jnp.swapaxes(seconds, 0, 1)
        later = game.motions[0].discount * interpolate(self.table, (other_grid, other), (grid, last(mine)))
        values = jnp.where(outcome == Outcome.ONGOING, later[:, None], game.payoff_of(outcome, seconds))
        return jnp.min(values, axis=1)


@eqx.filter_jit
def _best_values(player: AbstractSearch, states: GameState) -> Float[Array, " games"]:
    own, other = player.zero_sum_game.pair(states.pursuer, states.evader)
    return jnp.max(player.action_values(own, other, jnp.zeros(own.x.shape, jnp.uint32)), axis=0)
