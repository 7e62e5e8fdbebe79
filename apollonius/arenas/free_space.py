"""Where both robots of a game can be: a raster of its largest part, the islands in it, and hexagonal cells as a graph.

The graph is planar, with a node for each piece of free space. A cell that obstacles cut in two has two nodes, so no
passage is lost and none is invented, however coarse the cells. Where there is no island, one pursuer is enough on the
graph, as it should be: every cycle has triangles inside, and no node in the midst has fewer than six neighbours. Such a
graph is bridged (Chepoi, 2000), and one pursuer is enough on every bridged graph (Anstee and Farber, 1988).
"""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from apollonius.arenas.survey import clearances_at, places
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.obstacle import AbstractObstacle
from apollonius.io.errors import require

_AROUND = np.ones((3, 3))
"""Obstacles that touch at a corner let nothing through."""


@dataclass(frozen=True)
class Island:
    """An obstacle, or several that leave no room between them, with free space all around.

    Attributes:
        x, y: a place in it, next to its middle [m].
        obstacles: what they are called in a game's file.
    """

    x: float
    y: float
    obstacles: tuple[str, ...] = ()


@dataclass(frozen=True)
class FreeSpace:
    """Where the centres of both robots can be, `[rows, columns]`, the first row at the bottom.

    Attributes:
        free: which places: the largest part of all that are free.
        x, y: the lower left corner [m].
        cell: side of a place [m].
        parts: how many parts there are that no robot leaves.
        islands: in the largest one.
    """

    free: Bool[np.ndarray, "rows columns"]
    x: float
    y: float
    cell: float
    parts: int
    islands: tuple[Island, ...]

    @property
    def area(self) -> float:
        """Of the largest part [m^2]."""
        return float(self.free.sum()) * self.cell**2


def free_space(game: Game) -> FreeSpace:
    """That of the larger of a game's robots.

    Raises:
        InvalidInput: where there is none.
    """
    arena = game.arena
    x, y, cell = places(arena)
    radius = max(float(game.pursuer.radius), float(game.evader.radius))
    clearances = clearances_at(arena, x, y)
    free = clearances.min(axis=0) >= radius
    require(free.any(), "radius", f"{radius:g} m", "so small that a robot fits somewhere into the arena")
    names = np.array(_names(arena))
    nearest = clearances[4:].argmin(axis=0) if len(names) else np.zeros(free.shape, int)
    return largest_part(free, float(arena.x_min), float(arena.y_min), cell, names[nearest] if len(names) else None)


def largest_part(
    free: Bool[np.ndarray, "rows columns"], x: float, y: float, cell: float, names: np.ndarray | None = None
) -> FreeSpace:
    """The largest part of a raster's free places, and the islands in it.

    Args:
        free: which places are, at least one of them, the first row at the bottom.
        x, y: the lower left corner [m].
        cell: side of a place [m].
        names: of the obstacle that is nearest to each place.
    """
    parts, count = _labelled(free)
    largest = parts == 1 + np.argmax(np.bincount(parts[free])[1:])
    # What is joined to the outside is no island; its number is the first one.
    rest, islands = _labelled(np.pad(~largest, 1, constant_values=True), _AROUND)
    rest = rest[1:-1, 1:-1]
    found = []
    for number in range(2, islands + 1):
        rows, columns = np.nonzero(rest == number)
        middle = np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2)
        inside = () if names is None else tuple(map(str, np.unique(names[rows, columns])))
        found.append(Island(x + (columns[middle] + 0.5) * cell, y + (rows[middle] + 0.5) * cell, inside))
    return FreeSpace(largest, x, y, cell, count, tuple(found))


def _labelled(
    places: Bool[np.ndarray, "rows columns"], structure: np.ndarray | None = None
) -> tuple[Int[np.ndarray, "rows columns"], int]:
    """Connected parts numbered from 1, and how many there are; by default parts do not touch at corners."""
    numbered = np.zeros(places.shape, np.int32)
    count = int(label(places, structure=structure, output=numbered))  # pyright: ignore[reportArgumentType]
    return numbered, count


def _names(arena: Arena) -> list[str]:
    """Those of `arena.obstacles` in a game's file."""
    found = []
    for field in fields(arena):
        value = getattr(arena, field.name)
        if field.name not in ("territory", "chart"):
            one = isinstance(value, AbstractObstacle)
            found += [f"arena.{field.name}"] if one else []
            found += [f"arena.{field.name}[{i}]" for i in range(len(value))] if isinstance(value, tuple) else []
    return found


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
