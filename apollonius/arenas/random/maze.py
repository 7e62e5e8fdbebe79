"""Mazes: corridors as wide as the gap along a spanning tree, some of the walls between them taken out again."""

import numpy as np

from apollonius.arenas.random.layout import WALL, Layout, rectangle
from apollonius.errors import require
from apollonius.game.arena import Arena
from apollonius.game.polygon import Polygon

_WIDER = 1.25
"""Width of a corridor, in gaps."""
_OPENED = 0.35
"""Share of the tree's walls that are taken out: a maze without ways round is no place to flee in."""


def maze(layout: Layout, rng: np.random.Generator) -> Arena:
    """As many cells as fit, each joined to the others by corridors.

    Raises:
        InvalidInput: where fewer than two by two fit.
    """
    pitch = _WIDER * layout.gap + WALL
    columns, rows = (int((side + WALL) / pitch) for side in (layout.width, layout.height))
    enough = f"at least {2 * pitch - WALL:g} m each, two corridors with a wall between"
    require(min(columns, rows) >= 2, "width, height", (layout.width, layout.height), enough)
    # A wall stands between a cell and its right neighbour, and between it and its upper one.
    right, up = np.ones((columns - 1, rows), bool), np.ones((columns, rows - 1), bool)
    _carve(right, up, rng)
    right &= rng.uniform(size=right.shape) >= _OPENED
    up &= rng.uniform(size=up.shape) >= _OPENED
    wide, high = layout.width / columns, layout.height / rows
    walls: list[Polygon] = []
    for column in range(columns - 1):
        for low, top in _runs(right[column]):
            x = (column + 1) * wide
            walls.append(_wall(x - WALL / 2, low * high, x + WALL / 2, top * high, layout))
    for row in range(rows - 1):
        for low, top in _runs(up[:, row]):
            y = (row + 1) * high
            walls.append(_wall(low * wide, y - WALL / 2, top * wide, y + WALL / 2, layout))
    return layout.arena(walls)


def _carve(right: np.ndarray, up: np.ndarray, rng: np.random.Generator) -> None:
    """Take out walls until every cell can be reached in one way, by a walk that goes back where it cannot go on."""
    columns, rows = up.shape[0], right.shape[1]
    way, seen = [(0, 0)], {(0, 0)}
    while way:
        x, y = way[-1]
        beside = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        new = [one for one in beside if 0 <= one[0] < columns and 0 <= one[1] < rows and one not in seen]
        if not new:
            way.pop()
            continue
        to = new[rng.integers(len(new))]
        if to[1] == y:
            right[min(x, to[0]), y] = False
        else:
            up[x, min(y, to[1])] = False
        seen.add(to)
        way.append(to)


def _runs(walls: np.ndarray) -> list[tuple[int, int]]:
    """Where rows of walls begin and end: each is one long wall."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], walls.astype(int), [0]])))
    return [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def _wall(left: float, bottom: float, right: float, top: float, layout: Layout) -> Polygon:
    """A wall that ends in the middle of those it meets, so that no slit is left, but not beyond the arena's."""
    if right - left > top - bottom:
        left, right = left - WALL / 2, right + WALL / 2
    else:
        bottom, top = bottom - WALL / 2, top + WALL / 2
    return rectangle(max(left, 0.0), max(bottom, 0.0), min(right, layout.width), min(top, layout.height))
