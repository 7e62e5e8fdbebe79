"""The grid that is taken where nobody asks for another."""

from math import ceil, tau

from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.solve.grid import Grid, make_grid

SPACING = 0.2
"""Distance between neighbours along x and y [m], where that takes no more than `MOST` nodes."""
MOST = 101
"""Nodes along x and along y."""
HOLD = 0.5
"""How long an action is held [s]: long enough to leave a cell, short enough to steer."""
_HEADINGS = range(40, 65)
"""Numbers of headings among which a hold's turn comes closest to whole cells of one."""
_FASTER = 0.05
"""Least distance between neighbouring speeds [m/s]."""
PAIRS = 1.2e8
"""About as many pairs of nodes has the grid of two robots."""
FEW_PAIRS = 1e7
"""The same of one that is solved in seconds."""
_SPEEDS = 5
"""Its speeds."""
_LONGEST = 2.0
"""Its longest hold [s]."""


def reference_grid(game: Game, role: Role) -> tuple[Grid, int]:
    """A grid on which a hold moves the robot by whole cells of speed, and as nearly as can be of heading.

    Returns:
        The grid, and the control steps for which an action is held.
    """
    body = game.body(role)
    dt = float(game.dt)
    hold = max(1, round(HOLD / dt))
    speeds = max(2, 1 + ceil((body.v_max - body.v_min) / max(float(body.u1_max) * dt * hold, _FASTER) - 1e-6))
    turn = float(body.u2_max) * dt * hold
    headings = min(_HEADINGS, key=lambda count: abs(_cells(turn, count) - round(_cells(turn, count))))
    arena = game.arena
    x, y = (min(ceil(size / SPACING) + 1, MOST) for size in (arena.x_max - arena.x_min, arena.y_max - arena.y_min))
    return make_grid(arena, body, (x, y, speeds, headings)), hold


def steering_grid(game: Game, role: Role) -> tuple[Grid, int]:
    """A coarser grid, for a table that only advises: what it says is tried out in the continuous game.

    It has half as many nodes along x and y, and a hold turns the robot by about one cell of heading.

    Returns:
        The grid, and the control steps for which an action is held.
    """
    grid, hold = reference_grid(game, role)
    x, y, speeds, headings = grid.counts
    turn = float(game.body(role).u2_max) * float(game.dt) * hold
    headings = min(max(round(tau / max(turn, 1e-6)), 8), headings)
    return make_grid(game.arena, game.body(role), (x // 2 + 1, y // 2 + 1, speeds, headings)), hold


def joint_grid(game: Game, role: Role, pairs: float = PAIRS) -> tuple[Grid, int]:
    """The grid of one robot of two: coarser, since pairs of nodes count.

    Args:
        pairs: about how many of them.

    Returns:
        The grid, and the control steps for which actions are held: both robots', by the pursuer's limits.
    """
    lead, dt, arena = game.pursuer, float(game.dt), game.arena
    faster = (float(lead.v_max) - float(lead.v_min)) / (_SPEEDS - 1)
    hold = max(1, min(round(faster / max(float(lead.u1_max), _FASTER) / dt), round(_LONGEST / dt)))
    headings = min(max(8, round(tau / max(float(lead.u2_max) * dt * hold, 1e-6))), 16)
    places = pairs**0.5 / (_SPEEDS * headings)
    shape = (float(arena.x_max) - float(arena.x_min)) / (float(arena.y_max) - float(arena.y_min))
    x, y = (max(2, round((places * ratio) ** 0.5)) for ratio in (shape, 1 / shape))
    return make_grid(arena, game.body(role), (x, y, _SPEEDS, headings)), hold


def _cells(angle: float, count: int) -> float:
    """An angle [rad] in cells of a circle divided into so many."""
    return angle * count / tau
