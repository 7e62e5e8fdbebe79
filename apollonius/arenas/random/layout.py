"""What all kinds of random arenas are drawn by: a size, a gap, random numbers; and rectangles to build with."""

from dataclasses import dataclass

import numpy as np

from apollonius.game.arena import Arena
from apollonius.game.polygon import Polygon

WALL = 0.2
"""Thickness of a wall inside an arena [m]."""
TRIES = 2000
"""Places tried for whatever has to find one."""


@dataclass(frozen=True)
class Layout:
    """What is asked for: a rectangle from the origin on, and how wide its passages are at least [m]."""

    width: float
    height: float
    gap: float

    def arena(self, polygons: list[Polygon]) -> Arena:
        """The rectangle with these obstacles in it."""
        return Arena(x_max=self.width, y_max=self.height, polygons=tuple(polygons))


def rectangle(left: float, bottom: float, right: float, top: float) -> Polygon:
    """One with sides along x and y."""
    return Polygon(((left, bottom), (right, bottom), (right, top), (left, top)))


def apart(places: list[tuple[float, float, float]], place: tuple[float, float, float], gap: float) -> bool:
    """Whether a circle (x, y, radius) keeps a gap from all others."""
    x, y, radius = place
    return all(np.hypot(x - one, y - other) >= radius + size + gap for one, other, size in places)
