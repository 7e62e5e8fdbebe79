"""Passages too narrow for an arena's chart: players that read it, such as `pursuer`, know no path through them."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from apollonius.arenas.charting import charted, largest_radius
from apollonius.arenas.survey import clearances_at, places
from apollonius.game.chart import COARSE, NO_PATH, SIDE
from apollonius.game.game import Game

_LONGER = 1.1
"""Factor by which a path of a chart may be longer than a straight one, as it goes in sixteen directions."""
_DETOUR = 3.0
"""Coarse cells by which a chart's path may be longer than the real one before a passage counts as missed."""
_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""Steps from each cell of the raster to four of its eight neighbours, rows and columns."""


@dataclass(frozen=True)
class MissedPassage:
    """A passage that the larger robot fits through, and that the chart of its arena does not have.

    Attributes:
        x, y: a point in it [m].
        resolves: least width [m] of passages for this robot in the chart.
        detour: excess length of the chart's path [m]; inf where it has none.
    """

    x: float
    y: float
    resolves: float
    detour: float

    def __str__(self) -> str:
        detour = "know no other way" if np.isinf(self.detour) else f"know a way that is {self.detour:.1f} m longer"
        return (
            f"the passage at ({self.x:.2f}, {self.y:.2f}) is too narrow for the chart of pursuer and E_any: they "
            f"{detour}. This arena's chart resolves {self.resolves:.2f} m, so widen it to that."
        )


def missed_passage(game: Game) -> MissedPassage | None:
    """Return the passage that costs players with a chart the longest detour, in one arena; None if they miss none.

    From every coarse cell of the chart the free space is flooded on a fine raster. Where two floods meet, the robot can
    go from one cell to the other; the chart should have a path about as short.
    """
    arena, radius, chart = game.arena, largest_radius(game), charted(game).arena.chart
    assert chart is not None, "which a charted game has"
    lengths = np.asarray(chart.lengths)[0]
    side = float(np.asarray(chart.side)[0])
    x, y, cell = places(arena)
    clearance = clearances_at(arena, x, y) - radius
    graph, start, end, length = _links(clearance, cell)
    others = np.where(np.eye(len(lengths), dtype=bool), NO_PATH, lengths)
    cells = np.flatnonzero(others.min(axis=1) < NO_PATH)
    rows, columns = (((np.array(index) + 0.5) * side / COARSE / cell).astype(int) for index in np.divmod(cells, COARSE))
    inside = (rows < clearance.shape[0]) & (columns < clearance.shape[1])
    seeds, cells = (rows * clearance.shape[1] + columns)[inside], cells[inside]
    if not len(seeds):
        return None
    away, _, source = dijkstra(graph, directed=False, indices=seeds, min_only=True, return_predecessors=True)
    cell_at = np.zeros(clearance.size, int)
    cell_at[seeds] = cells
    meet = np.flatnonzero((source[start] != source[end]) & np.isfinite(away[start] + away[end]))
    if not len(meet):
        return None
    start, end = start[meet], end[meet]
    real = away[start] + length[meet] + away[end]
    charted_length = lengths[cell_at[source[start]], cell_at[source[end]]]
    detour = np.where(charted_length == NO_PATH, np.inf, charted_length / 100 - _LONGER * real)
    worst = np.argmax(detour)
    if detour[worst] <= _DETOUR * side / COARSE:
        return None
    at = start[worst]
    resolves = 2 * radius + side / COARSE + side / SIDE
    return MissedPassage(float(x.ravel()[at]), float(y.ravel()[at]), resolves, float(detour[worst]))


def _links(
    clearance: Float[np.ndarray, "rows columns"], cell: float
) -> tuple[csr_array, Int[np.ndarray, " links"], Int[np.ndarray, " links"], Float[np.ndarray, " links"]]:
    """Return neighbouring cells between which a robot surely fits, as a graph and as lists of ends and lengths [m].

    Args:
        clearance: of the robot's body in the middle of each cell [m]. A line between two middles is free if it is no
            longer than the sum of their clearances.
        cell: side of a cell [m].
    """
    number = np.arange(clearance.size).reshape(clearance.shape)
    starts, ends, lengths = [], [], []
    for up, right in _STEPS:
        here = np.s_[: clearance.shape[0] - up, max(0, -right) : clearance.shape[1] - max(0, right)]
        there = np.s_[up:, max(0, right) : clearance.shape[1] + min(0, right)]
        length = cell * np.hypot(up, right)
        free = (clearance[here] >= 0) & (clearance[there] >= 0) & (clearance[here] + clearance[there] >= length)
        starts.append(number[here][free])
        ends.append(number[there][free])
        lengths.append(np.full(int(free.sum()), length))
    start, end, length = (np.concatenate(parts) for parts in (starts, ends, lengths))
    return csr_array((length, (start, end)), shape=(clearance.size, clearance.size)), start, end, length
