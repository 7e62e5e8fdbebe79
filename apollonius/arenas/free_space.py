"""The free space of both robots of a game: a raster of its largest part, the islands in it, and a graph of hexagons.

The graph is planar, with a node for each piece of free space. A cell that obstacles cut in two has two nodes, so no
passage is lost and none is invented, however coarse the cells. Where there is no island, one pursuer is enough on the
graph, as it should be: every cycle has triangles inside, and no node in the midst has fewer than six neighbours. Such a
graph is bridged (Chepoi, 2000), and one pursuer is enough on every bridged graph (Anstee and Farber, 1988).
"""

from dataclasses import dataclass
<<<<<<< HEAD
=======
from functools import cached_property
>>>>>>> 9bc97b6 (The solved game has one payoff and a known opponent one search; the solver's tests and words are fewer)

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

<<<<<<< HEAD
from apollonius.arenas.survey import clearances_at, connected, places
=======
from apollonius.arenas.survey import clearances_at, places
>>>>>>> 9bc97b6 (The solved game has one payoff and a known opponent one search; the solver's tests and words are fewer)
from apollonius.game.game import Game
from apollonius.io.errors import require


@dataclass(frozen=True)
<<<<<<< HEAD
class Island:
    """An obstacle, or several without a passage between them, with free space all around.

    Attributes:
        x, y: a point in it, next to its middle [m].
        obstacles: their names in a game's file.
    """

    x: float
    y: float
    obstacles: tuple[str, ...] = ()


@dataclass(frozen=True)
class FreeSpace:
    """The places of both robots' centres, `[rows, columns]`, the first row at the bottom.
=======
class FreeSpace:
    """The places where the centres of both robots can be, `[rows, columns]`, the first row at the bottom.
>>>>>>> 9bc97b6 (The solved game has one payoff and a known opponent one search; the solver's tests and words are fewer)

    Attributes:
        free: the largest connected part.
        x, y: the lower left corner [m].
<<<<<<< HEAD
        cell: side of a cell [m].
        parts: number of connected parts.
        islands: the islands in the largest part.
=======
        cell: side of a place [m].
        parts: how many parts there are that no robot leaves.
        islands: how many there are in the largest one: obstacles with free space all around.
>>>>>>> 9bc97b6 (The solved game has one payoff and a known opponent one search; the solver's tests and words are fewer)
    """

    free: Bool[np.ndarray, "rows columns"]
    x: float
    y: float
    cell: float
    parts: int
    islands: int

    @property
    def area(self) -> float:
<<<<<<< HEAD
        """The area of the largest part [m^2]."""
=======
        """Area of the largest part [m^2]."""
>>>>>>> 9bc97b6 (The solved game has one payoff and a known opponent one search; the solver's tests and words are fewer)
        return float(self.free.sum()) * self.cell**2


def free_space(game: Game) -> FreeSpace:
<<<<<<< HEAD
    """Return the free space of a game's larger robot.

    Raises:
        InvalidInput: where it fits nowhere.
=======
    """Return the free space of the larger of a game's robots.

    Raises:
        InvalidInput: where no robot fits.
>>>>>>> 9bc97b6 (The solved game has one payoff and a known opponent one search; the solver's tests and words are fewer)
    """
    arena = game.arena
    x, y, cell = places(arena)
    radius = max(float(game.pursuer.radius), float(game.evader.radius))
    free = clearances_at(arena, x, y).min(axis=0) >= radius
    require(free.any(), "radius", f"{radius:g} m", "so small that a robot fits somewhere into the arena")
<<<<<<< HEAD
    names = np.array(list(arena.named_obstacles))
    nearest = clearances[4:].argmin(axis=0) if len(names) else np.zeros(free.shape, int)
    return largest_part(free, float(arena.x_min), float(arena.y_min), cell, names[nearest] if len(names) else None)


def largest_part(
    free: Bool[np.ndarray, "rows columns"], x: float, y: float, cell: float, names: np.ndarray | None = None
) -> FreeSpace:
    """Return the largest part of a raster's free cells, and the islands in it.
=======
    return largest_part(free, float(arena.x_min), float(arena.y_min), cell)


def largest_part(free: Bool[np.ndarray, "rows columns"], x: float, y: float, cell: float) -> FreeSpace:
    """Return the largest part of a raster's free places, and the number of islands in it.
>>>>>>> 9bc97b6 (The solved game has one payoff and a known opponent one search; the solver's tests and words are fewer)

    Args:
        free: the free cells, at least one, the first row at the bottom.
        x, y: the lower left corner [m].
<<<<<<< HEAD
        cell: side of a cell [m].
        names: the name of the obstacle nearest to each cell.
=======
        cell: side of a place [m].
>>>>>>> 9bc97b6 (The solved game has one payoff and a known opponent one search; the solver's tests and words are fewer)
    """
    parts, count = connected(free, corners=False)
    largest = parts == 1 + np.argmax(np.bincount(parts[free])[1:])
<<<<<<< HEAD
    # What is joined to the outside is no island; its number is the first one.
    rest, islands = connected(np.pad(~largest, 1, constant_values=True))
    rest = rest[1:-1, 1:-1]
    found = []
    for number in range(2, islands + 1):
        rows, columns = np.nonzero(rest == number)
        middle = np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2)
        inside = () if names is None else tuple(map(str, np.unique(names[rows, columns])))
        found.append(Island(x + (columns[middle] + 0.5) * cell, y + (rows[middle] + 0.5) * cell, inside))
    return FreeSpace(largest, x, y, cell, count, tuple(found))


=======
    _, islands = _labelled(np.pad(~largest, 1, constant_values=True), _AROUND)
    return FreeSpace(largest, x, y, cell, count, islands - 1)  # what is joined to the outside is no island


def _labelled(
    places: Bool[np.ndarray, "rows columns"], structure: np.ndarray | None = None
) -> tuple[Int[np.ndarray, "rows columns"], int]:
    """Number connected parts from 1, and count them; by default parts do not touch at corners."""
    numbered = np.zeros(places.shape, np.int32)
    count = int(label(places, structure=structure, output=numbered))  # pyright: ignore[reportArgumentType]
    return numbered, count


>>>>>>> 9bc97b6 (The solved game has one payoff and a known opponent one search; the solver's tests and words are fewer)
@dataclass(frozen=True)
class Tiling:
    """A graph of an arena. Two nodes are neighbours where their pieces of cells share a part of a side.

    Attributes:
        places: a point of each node [m], next to the middle of its piece.
        adjacency: which nodes are neighbours, never of themselves.
        spacing: between the middles of neighbouring cells [m].
        angle: of the cells [rad].
    """

    places: Float[np.ndarray, "nodes 2"]
    adjacency: Bool[np.ndarray, "nodes nodes"]
    spacing: float
    angle: float

    @cached_property
    def holes(self) -> int:
<<<<<<< HEAD
        """The number of cycles not filled by triangles: of islands large enough for the graph."""
=======
        """Number of cycles that triangles do not fill: islands that are large enough for the graph to see them."""
>>>>>>> 9bc97b6 (The solved game has one payoff and a known opponent one search; the solver's tests and words are fewer)
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
<<<<<<< HEAD
    """Return a number for the hexagon around each point; the middles of neighbours are 1 apart."""
=======
    """Return a number for the cell of each place; the middles of neighbouring cells are 1 apart."""
>>>>>>> 9bc97b6 (The solved game has one payoff and a known opponent one search; the solver's tests and words are fewer)
    high = np.sqrt(3)
    one = np.round(x), np.round(y / high)
    other = np.floor(x), np.floor(y / high)
    to_one = (x - one[0]) ** 2 + (y - high * one[1]) ** 2
    to_other = (x - other[0] - 0.5) ** 2 + (y - high * (other[1] + 0.5)) ** 2
    column = np.where(to_one < to_other, 2 * one[0], 2 * other[0] + 1).astype(int)
    row = np.where(to_one < to_other, 2 * one[1], 2 * other[1] + 1).astype(int)
    column, row = column - column.min(), row - row.min()
    return row * (int(column.max()) + 1) + column
