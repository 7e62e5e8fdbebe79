"""The knowledge that one side has of a state of the game: all that its players see."""

import equinox as eqx
from jaxtyping import Array, Bool, Float, Int

from apollonius.game.types import (
    BySide,
    DriveStates,
    Flag,
    GameState,
    MoverMotion,
    RobotState,
    active_flags,
)


class Knowledge(eqx.Module):
    """A state of the game as one side knows it, or the states of several games.

    Attributes:
        robots: the states of all robots; with sensors the side's own with their errors, and of
            opponents the last sightings.
        status: a `RobotStatus` for each robot.
        variant: as in `GameState`.
        drives: those of the side's robots; empty where they are not known.
        ages: for how long each opponent has been hidden [s]; None for a side that sees everything.
        movers: places and velocities of movers; those of hidden ones mean nothing.
        movers_in_sight: which of these are not hidden; None for a side that sees everything.
        belief: with a chart, the time since each coarse cell was last seen [s], negative where no
            opponent can be; None for a side that sees everything.
    """

    robots: BySide[tuple[RobotState, ...]]
    status: BySide[tuple[Int[Array, "*games"], ...]]
    variant: Int[Array, "*games"] | None = None
    drives: DriveStates = ()
    ages: tuple[Float[Array, "*games"], ...] | None = None
    belief: Float[Array, "*games rows columns"] | None = None
    movers: MoverMotion | None = None
    movers_in_sight: Bool[Array, "*games movers"] | None = None

    @classmethod
    def complete(cls, state: GameState, drives: DriveStates = ()) -> "Knowledge":
        """Return the knowledge of a side that sees everything."""
        movers = state.movers and state.movers.motion
        return cls(state.robots, state.status, state.variant, drives, movers=movers)

    @property
    def active(self) -> BySide[tuple[Flag, ...]]:
        """Check whether each robot is in play."""
        return active_flags(self.status)
