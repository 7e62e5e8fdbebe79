"""The two-robot game as one side sees it: what outcomes are worth to it, and what happens while actions are held."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from apollonius.errors import require
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.outcome import evader_wins, pursuer_wins
from apollonius.game.types import Real, RobotState, Role
from apollonius.limits import JOINT_HOLD
from apollonius.solve.event import first_event
from apollonius.solve.grid import Grid
from apollonius.solve.motion import Motion, discount_after, motion_of

PAYOFFS = {"win": (1.0, -1.0), "time": (1.0, 0.0)}
"""What winning and losing is worth to the pursuer, times `discount_after` the seconds until then; else 0."""


class ZeroSumGame(eqx.Module):
    """The two-robot game, from one side. What one gains the other loses.

    Attributes:
        game: the rules.
        motions, grids: of this side's robot, then the other's.
        win, lose: what it is worth to this side to win, and to lose, at once.
        role: the side.
    """

    game: Game
    motions: tuple[Motion, Motion]
    grids: tuple[Grid, Grid]
    win: Real
    lose: Real
    role: Role = eqx.field(static=True)

    @property
    def capture(self) -> Real:
        """What it is worth to this side if the evader is captured at once."""
        return self.win if self.role == Role.PURSUER else self.lose

    def pair(self, own: RobotState, other: RobotState) -> tuple[RobotState, RobotState]:
        """The pursuer's state and the evader's."""
        return BySide.of(self.role, own, other).pair

    def event(self, own: RobotState, other: RobotState) -> tuple[Bool[Array, ""], Float[Array, ""]]:
        """Whether the rules end the game along two courses (leaves `[steps + 1]`), and what that is worth."""
        over, outcome, seconds = first_event(self.game, *self.pair(own, other))
        return over, self.payoff_of(outcome, seconds)

    def payoff_of(self, outcome: Int[Array, "*batch"], seconds: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
        """What an outcome after so many seconds is worth to this side."""
        won, lost = pursuer_wins(outcome), evader_wins(outcome, time_limit_wins=False)
        if self.role == Role.EVADER:
            won, lost = lost, won
        return discount_after(seconds) * jnp.where(won, self.win, jnp.where(lost, self.lose, 0.0))


def make_zero_sum_game(game: Game, grids: tuple[Grid, Grid], hold: int, role: Role, payoff: str) -> ZeroSumGame:
    """The two-robot game from one side.

    Args:
        grids: the pursuer's and the evader's.
        hold: control steps for which actions are held.
        payoff: `win` pays the pursuer 1 for a win and -1 for a loss; `time` pays it 1 for a win alone, so that only the
            time to it counts.

    Raises:
        InvalidInput: for an unknown payoff, and unless an action is held for 1 to 127 steps.
    """
    require(payoff in PAYOFFS, "payoff", payoff, f"one of {', '.join(PAYOFFS)}")
    JOINT_HOLD.require("hold", hold)
    won, lost = PAYOFFS[payoff]
    pursuer, evader = motion_of(game, Role.PURSUER, hold), motion_of(game, Role.EVADER, hold)
    if role == Role.PURSUER:
        return ZeroSumGame(game, (pursuer, evader), grids, won, lost, role)
    return ZeroSumGame(game, (evader, pursuer), (grids[1], grids[0]), -lost, -won, role)
