"""The grid that is taken where nobody asks for another."""

from math import ceil, tau

from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.solve.grid import Grid, make_grid

SPACING = 0.2
"""Distance between neighbours along x and y [m]."""
HOLD = 0.5
"""How long an action is held [s]: long enough to leave a cell, short enough to steer."""
_HEADINGS = range(40, 65)


def reference_grid(game: Game, role: Role) -> tuple[Grid, int]:
    """A grid on which a hold moves the robot by whole cells of speed, and as nearly as can be of heading.

    Returns:
        The grid, and the control steps for which an action is held.
    """
    body = game.pursuer if role == Role.PURSUER else game.evader
    hold = max(1, round(HOLD / game.dt))
    speeds = max(2, 1 + ceil((body.v_max - body.v_min) / max(body.u1_max * game.dt * hold, 0.05) - 1e-6))
    turn = body.u2_max * game.dt * hold
    headings = min(_HEADINGS, key=lambda count: abs(_cells(turn, count) - round(_cells(turn, count))))
    arena = game.arena
    x, y = (ceil(size / SPACING) + 1 for size in (arena.x_max - arena.x_min, arena.y_max - arena.y_min))
    return make_grid(arena, body, (x, y, speeds, headings)), hold


def _cells(angle: float, count: int) -> float:
    """An angle [rad] in cells of a circle divided into so many."""
    return angle * count / tau
