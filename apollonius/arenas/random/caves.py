"""Caves: random rock worn by a cellular automaton, then widened until all passages keep the gap, as
a map's cells.
"""

import hashlib

import jax.numpy as jnp
import numpy as np
import scipy  # its parts are loaded where they are used: `scipy.ndimage` alone takes 0.4 s
from jaxtyping import Bool

from apollonius.arenas.map_file import count_islands, keep_largest
from apollonius.arenas.random.scattered import Layout
from apollonius.game.arena import Arena
from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.io.errors import InvalidInput, require

_PER_GAP = 8
"""Cells across a gap."""
_MOST_CELLS = 1_000
"""Most cells along a side."""
_LEAST_SIDE = 4
"""Least length of the sides, in gaps."""
_REACH = _PER_GAP // 2 + 0.25
"""Clearance of the passages of a cave [cells]: half a gap, plus the shortfall of a map's
clearances.
"""
_ROCK = 0.47
"""Share of the cells that are rock at first."""
_WINDOW = 3
"""Reach of the cells, along x and y, whose majority a cell takes in a round [cells]."""
_ROUNDS = 4
"""Rounds in which all cells take the majority around them."""
_LEAST_FREE = 0.45
"""Least share of free cells."""
_PER_PILLAR = 30
"""Square gaps for each pillar, at least one: in a cave without loops nobody escapes."""
_TRIES = 200
"""Caves that are tried."""


def caves(layout: Layout, rng: np.random.Generator) -> Arena:
    """Draw a cave of cells an eighth of the gap wide, whose sides are the requested ones to within
    half a cell.

    Every point of it is within half a gap of the middle of a passage at least as wide as the gap,
    and all those middles are joined. Anything narrower, or cut off, is rock. Raises InvalidInput
    for less than four gaps along a side, for more than a thousand cells, and where no cave is
    found.
    """
    sides, cell = (layout.width, layout.height), layout.gap / _PER_GAP
    layout.require_sides(_LEAST_SIDE * layout.gap, f"{_LEAST_SIDE} gaps")
    columns, rows = (round(side / cell) for side in sides)
    least = max(sides) * _PER_GAP / _MOST_CELLS
    bound = f"at least {least:g} m, as a cave has {_MOST_CELLS:,} cells along a side"
    require(max(columns, rows) <= _MOST_CELLS, "gap", layout.gap, bound)
    pillars = max(1, round(columns * rows / (_PER_PILLAR * _PER_GAP**2)))
    for _ in range(_TRIES):
        free = _widen(_smooth(rng.random((rows, columns)) < _ROCK))
        if free.mean() >= _LEAST_FREE and count_islands(free) >= pillars and _is_connected(free):
            return _arena(~free, cell)
    raise InvalidInput(
        f"caves with passages of {layout.gap:g} m find no room: none of {_TRIES} leaves "
        f"{_LEAST_FREE:.0%} of the arena free and has {pillars} ways round; "
        "ask for a smaller gap, or a larger arena."
    )


def _smooth(rock: Bool[np.ndarray, "rows columns"]) -> Bool[np.ndarray, "rows columns"]:
    """Give each cell the majority of the cells around it, again and again; cells outside count as
    neither.
    """
    window = np.ones(2 * _WINDOW + 1, int)
    for _ in range(_ROUNDS):
        more = scipy.ndimage.convolve1d(np.where(rock, 1, -1), window, 0, mode="constant")
        rock = scipy.ndimage.convolve1d(more, window, 1, mode="constant") > 0
    return rock


def _widen(rock: Bool[np.ndarray, "rows columns"]) -> Bool[np.ndarray, "rows columns"]:
    """Return the free cells within reach of the largest connected part of the corners with that
    clearance.

    The corners keep it, as no cell that a disc around a corner touches was rock.
    """
    ways, count = keep_largest(_clearances(rock) >= _REACH)
    near = np.asarray(scipy.ndimage.distance_transform_edt(~ways)) < (_REACH if count else 0)
    return near[1:, 1:] | near[1:, :-1] | near[:-1, 1:] | near[:-1, :-1]


def _clearances(rock: Bool[np.ndarray, "rows columns"]) -> np.ndarray:
    """Return the clearances of the cells' corners from rock and walls [cells]."""
    return distance_field(np.pad(rock, 1, constant_values=True), 1.0)[1:-1, 1:-1]


def _is_connected(free: Bool[np.ndarray, "rows columns"]) -> bool:
    """Check whether robots of all sizes up to the gap find one connected part."""
    clearances = _clearances(~free)
    return all(
        keep_largest(clearances >= least)[1] <= 1 for least in np.linspace(0.5, _REACH, _PER_GAP)
    )


def _arena(rock: Bool[np.ndarray, "rows columns"], cell: float) -> Arena:
    content = f"{rock.shape} {cell!r}".encode() + np.packbits(rock).tobytes()
    field = jnp.asarray(distance_field(rock, cell))
    cells = OccupancyMap(field, 0.0, 0.0, cell, "", hashlib.sha256(content).hexdigest())
    return Arena(x_max=cells.x_max, y_max=cells.y_max, map=cells)
