"""An arena cut into hexagonal cells: a planar graph of where a robot can go, a node for each piece of free space.

A cell that obstacles cut in two has two nodes, so no passage is lost and none is invented, however coarse the cells.
Where there is no island, one pursuer is enough on the graph, as it should be: every cycle has triangles inside, and no
node in the midst has fewer than six neighbours. Such a graph is bridged (Chepoi, 2000), and one pursuer is enough on
every bridged graph (Anstee and Farber, 1988).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from apollonius.arenas.free_space import FreeSpace


@dataclass(frozen=True)
class Tiling:
    """A graph of an arena. Two nodes are neighbours where their pieces of cells share a part of a side.

    Attributes:
        places: of the nodes [m]: in each piece the place next to its middle.
        adjacency: which nodes are neighbours; none is its own.
        spacing: between the middles of neighbouring cells [m].
        angle: by which the cells are turned [rad].
    """

    places: Float[np.ndarray, "nodes 2"]
    adjacency: Bool[np.ndarray, "nodes nodes"]
    spacing: float
    angle: float

    @property
    def holes(self) -> int:
        """Cycles that are not filled by triangles: the islands that are large enough for the graph to see them."""
        links = self.adjacency.astype(np.float32)
        triangles = round(float(np.sum((links @ links) * links)) / 6)
        return int(self.adjacency.sum()) // 2 - len(links) + 1 - triangles


def tile(space: FreeSpace, spacing: float, angle: float) -> Tiling:
    """Cut free space into hexagonal cells.

    Args:
        space: what is cut.
        spacing: between the middles of neighbouring cells [m].
        angle: by which the cells are turned [rad].
    """
    rows, columns = np.nonzero(space.free)
    x, y = (columns + 0.5) * space.cell, (rows + 0.5) * space.cell
    cos, sin = np.cos(angle) / spacing, np.sin(angle) / spacing
    hexagon = _hexagons(cos * x + sin * y, cos * y - sin * x)
    number = np.full(space.free.shape, -1)
    number[rows, columns] = np.arange(len(rows))
    pairs = [
        np.stack([first[both], second[both]])
        for first, second in ((number[:, :-1], number[:, 1:]), (number[:-1], number[1:]))
        for both in [(first >= 0) & (second >= 0)]
    ]
    start, end = np.concatenate(pairs, axis=1)
    within = hexagon[start] == hexagon[end]
    links = coo_array((np.ones(int(within.sum()), bool), (start[within], end[within])), shape=(len(rows), len(rows)))
    count, piece = connected_components(links, directed=False)
    adjacency = np.zeros((count, count), bool)
    adjacency[piece[start[~within]], piece[end[~within]]] = True
    at = np.stack([x, y], axis=1)
    sizes = np.bincount(piece)
    middles = np.stack([np.bincount(piece, axis) / sizes for axis in at.T], axis=1)
    away = np.sum((at - middles[piece]) ** 2, axis=1)
    order = np.lexsort((away, piece))
    nearest = order[np.searchsorted(piece[order], np.arange(count))]
    return Tiling(at[nearest] + (space.x, space.y), adjacency | adjacency.T, spacing, angle)


def _hexagons(x: Float[np.ndarray, " places"], y: Float[np.ndarray, " places"]) -> Int[np.ndarray, " places"]:
    """A number for the cell that each place lies in; the middles of neighbouring cells are 1 apart."""
    high = np.sqrt(3)
    one = np.round(x), np.round(y / high)
    other = np.floor(x), np.floor(y / high)
    to_one = (x - one[0]) ** 2 + (y - high * one[1]) ** 2
    to_other = (x - other[0] - 0.5) ** 2 + (y - high * (other[1] + 0.5)) ** 2
    column = np.where(to_one < to_other, 2 * one[0], 2 * other[0] + 1).astype(int)
    row = np.where(to_one < to_other, 2 * one[1], 2 * other[1] + 1).astype(int)
    column, row = column - column.min(), row - row.min()
    return row * (int(column.max()) + 1) + column
