"""One robot on its grid: where its held actions lead, and which of them it survives."""

import equinox as eqx
from jaxtyping import Array, Bool

from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.solve.grid import Grid
from apollonius.solve.motion import Motion, motion_of
from apollonius.solve.transition_map import TransitionMap, rooms, transition_map_of


class Side(eqx.Module):
    """One robot on its grid; it knows no opponent.

    Attributes:
        motion, grid: the robot's.
        transitions: where its held actions lead.
        free: whether they touch nothing.
    """

    motion: Motion
    grid: Grid
    transitions: TransitionMap
    free: Bool[Array, "slices 9 x y"]

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
    return Side(motion, grid, transitions, rooms(motion, grid, transitions) >= 0)
