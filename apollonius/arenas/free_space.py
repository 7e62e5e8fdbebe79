"""The free space of both robots of a game: a raster of its largest part, the islands in it, and a
graph of hexagons.

The graph is planar, with a node for each piece of free space. A cell that obstacles cut in two has
two nodes, so no passage is lost and none is invented, however coarse the cells. Where there is no
island, one pursuer is enough on the graph, as it should be: every cycle has triangles inside, and
no node in the midst has fewer than six neighbours. Such a graph is bridged (Chepoi, 2000), and one
pursuer is enough on every bridged graph (Anstee and Farber, 1988).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from apollonius.arenas.map_file import count_islands, keep_largest
from apollonius.arenas.survey import grid_points
from apollonius.game.game import Game
from apollonius.io.errors import require


@dataclass(frozen=True)
class FreeSpace:
    """The places of both robots' centres: the largest connected part, the first row at the bottom.

    It has the lower left corner x, y and the side of a cell [m]; the number of all parts; and that
    of the islands in the largest one, obstacles with free space all around.
    """

    free: Bool[np.ndarray, "rows columns"]
    x: float
    y: float
    cell: float
    parts: int
    islands: int

    @property
    def area(self) -> float:
        """The area of the largest part [m^2]."""
        return float(self.free.sum()) * self.cell**2

    def spacing_of(self, cells: int) -> float:
        """Return the spacing [m] of hexagonal cells, this many of which fill the area."""
        return float(np.sqrt(2 * self.area / np.sqrt(3) / cells))


def free_space(game: Game) -> FreeSpace:
    """Return the free space of a game's larger robot; raises InvalidInput where it fits nowhere."""
    arena = game.arena
    _, _, cell, clearance = grid_points(arena)
    radius = max(float(game.pursuer.radius), float(game.evader.radius))
    free = clearance >= radius
    require(
        free.any(), "radius", f"{radius:g} m", "so small that a robot fits somewhere into the arena"
    )
    return largest_part(free, float(arena.x_min), float(arena.y_min), cell)


def largest_part(
    free: Bool[np.ndarray, "rows columns"], x: float, y: float, cell: float
) -> FreeSpace:
    """Return the largest part of a raster's free cells, and count the islands in it.

    Args:
        free: the free cells, one at least, the first row at the bottom.
        x, y: lower left corner of the raster [m].
        cell: side of a cell [m].
    """
    part, count = keep_largest(free)
    return FreeSpace(part, x, y, cell, count, count_islands(part))


@dataclass(frozen=True)
class Tiling:
    """A graph of an arena. Two nodes are neighbours where their pieces of cells share a part of a
    side.

    The place of a node [m] is next to the middle of its piece. Cells have a spacing between their
    middles [m] and are turned by an angle [rad].
    """

    places: Float[np.ndarray, "nodes 2"]
    adjacency: Bool[np.ndarray, "nodes nodes"]
    spacing: float
    angle: float

    @cached_property
    def holes(self) -> int:
        """The number of cycles not filled by triangles: of islands large enough for the graph."""
        links = self.adjacency.astype(np.float32)
        triangles = round(float(np.sum((links @ links) * links)) / 6)
        return int(self.adjacency.sum()) // 2 - len(links) + 1 - triangles


def tile(space: FreeSpace, spacing: float, angle: float) -> Tiling:
    """Cut free space into hexagonal cells with a spacing [m], turned by an angle [rad]."""
    rows, columns = np.nonzero(space.free)
    x, y = (columns + 0.5) * space.cell, (rows + 0.5) * space.cell
    cos, sin = np.cos(angle) / spacing, np.sin(angle) / spacing
    hexagon = _hexagons(cos * x + sin * y, cos * y - sin * x)
    number = np.full(space.free.shape, -1)
    number[rows, columns] = np.arange(len(rows))
    pairs = [
        np.stack([first[is_pair], second[is_pair]])
        for first, second in ((number[:, :-1], number[:, 1:]), (number[:-1], number[1:]))
        for is_pair in [(first >= 0) & (second >= 0)]
    ]
    start, end = np.concatenate(pairs, axis=1)
    same_cell = hexagon[start] == hexagon[end]
    links = coo_array(
        (np.ones(int(same_cell.sum()), bool), (start[same_cell], end[same_cell])),
        shape=(len(rows), len(rows)),
    )
    count, piece = connected_components(links, directed=False)
    adjacency = np.zeros((count, count), bool)
    adjacency[piece[start[~same_cell]], piece[end[~same_cell]]] = True
    points = np.stack([x, y], axis=1)
    sizes = np.bincount(piece)
    middles = np.stack([np.bincount(piece, axis) / sizes for axis in points.T], axis=1)
    distances = np.sum((points - middles[piece]) ** 2, axis=1)
    order = np.lexsort((distances, piece))
    nearest = order[np.searchsorted(piece[order], np.arange(count))]
    return Tiling(points[nearest] + (space.x, space.y), adjacency | adjacency.T, spacing, angle)


def _hexagons(
    x: Float[np.ndarray, " grid_points"], y: Float[np.ndarray, " grid_points"]
) -> Int[np.ndarray, " grid_points"]:
    """Return a number for the hexagon around each point; the middles of neighbours are 1 apart."""
    high = np.sqrt(3)
    even = np.round(x), np.round(y / high)
    odd = np.floor(x), np.floor(y / high)
    to_even = (x - even[0]) ** 2 + (y - high * even[1]) ** 2
    to_odd = (x - odd[0] - 0.5) ** 2 + (y - high * (odd[1] + 0.5)) ** 2
    column = np.where(to_even < to_odd, 2 * even[0], 2 * odd[0] + 1).astype(int)
    row = np.where(to_even < to_odd, 2 * even[1], 2 * odd[1] + 1).astype(int)
    column, row = column - column.min(), row - row.min()
    return row * (int(column.max()) + 1) + column
