"""One robot on its grid: where its held actions lead, and which of them it survives."""

import equinox as eqx
from jaxtyping import Array, Bool, UInt8

from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.solve.grid import Grid
from apollonius.solve.motion import NEVER, Motion, motion_of
from apollonius.solve.transition_map import TransitionMap, failures, transition_map_of


class Side(eqx.Module):
    """One robot on its grid; it knows no opponent.

    Attributes:
        motion, grid: the robot's.
        transitions: where its held actions lead.
        failure: the step in which they touch something; `NEVER` if in none.
    """

    motion: Motion
    grid: Grid
    transitions: TransitionMap
    failure: UInt8[Array, "slices 9 x y"]

    @property
    def free(self) -> Bool[Array, "slices 9 x y"]:
        """Whether the robot survives the whole hold."""
        return self.failure == NEVER

    @property
    def farthest(self) -> float:
        """How far it can move in a hold [m]."""
        body = self.motion.body
        return float(max(abs(body.v_min), abs(body.v_max)) * self.motion.seconds)


def make_side(game: Game, role: Role, grid: Grid, hold: int, slack: float = 0.0) -> Side:
    """One robot of a game on its grid.

    Args:
        hold: control steps for which an action is held.
        slack: turns within this many cells of a whole number of them are taken for it (`transition_map_of`).

    Raises:
        InvalidInput: unless an action is held for at least one step.
    """
    motion = motion_of(game, role, hold)
    transitions = transition_map_of(motion, grid, slack)
    return Side(motion, grid, transitions, failures(motion, grid, transitions))
