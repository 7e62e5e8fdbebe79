"""Where both robots of a game can be, as a raster: its largest part, and the islands of obstacles in it."""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Int
from scipy.ndimage import label

from apollonius.arenas.survey import clearances_at, places
from apollonius.errors import require
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.obstacle import AbstractObstacle

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
