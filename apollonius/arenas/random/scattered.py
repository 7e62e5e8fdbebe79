"""What all kinds of random arenas are drawn by; and obstacles scattered at random, discs or blocks, that keep a gap."""

from dataclasses import dataclass

import numpy as np

from apollonius.game.arena import Arena, Disc
from apollonius.game.polygon import Polygon
from apollonius.io.errors import InvalidInput, require
from apollonius.io.limits import DISCS

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
        return Arena(x_max=self.width, y_max=self.height, polygons=tuple(polygons))


def rectangle(left: float, bottom: float, right: float, top: float) -> Polygon:
    """One with sides along x and y."""
    return Polygon(((left, bottom), (right, bottom), (right, top), (left, top)))


def apart(places: list[tuple[float, float, float]], place: tuple[float, float, float], gap: float) -> bool:
    """Whether a circle (x, y, radius) keeps a gap from all others."""
    x, y, radius = place
    return all(np.hypot(x - one, y - other) >= radius + size + gap for one, other, size in places)


_DISC_RADIUS = (0.3, 0.8)
"""Smallest and largest radius of a disc [m], unless another is asked for."""
_PER_AREA = 0.05
"""Discs on each square metre where nobody says how many."""


def discs(
    layout: Layout, rng: np.random.Generator, count: int | None = None, radius: tuple[float, float] = _DISC_RADIUS
) -> Arena:
    """Discs that keep the gap from each other and from the walls.

    Every robot of a diameter below the gap can go from any free place to any other: discs grown by its radius touch
    neither each other nor the walls, and separate round obstacles do not cut a rectangle in parts.

    Args:
        count: how many; None for one on every twenty square metres.
        radius: smallest and largest radius of a disc [m]; uniform between.

    Raises:
        InvalidInput: for impossible numbers, and where so many discs find no room.
    """
    least, most = radius
    count = round(_PER_AREA * layout.width * layout.height) if count is None else count
    DISCS.require("discs", count)
    require(0 < least <= most, "radius", radius, "more than 0 m, the smallest first")
    require(
        2 * (most + layout.gap) < min(layout.width, layout.height), "width, height", (layout.width, layout.height),
        f"more than {2 * (most + layout.gap):g} m each, the largest disc with a gap on either side",
    )  # fmt: skip
    placed: list[tuple[float, float, float]] = []
    for index in range(count):
        for _ in range(TRIES):
            size = rng.uniform(least, most)
            x, y = rng.uniform(size + layout.gap, np.array([layout.width, layout.height]) - size - layout.gap)
            if apart(placed, (x, y, size), layout.gap):
                placed.append((float(x), float(y), float(size)))
                break
        else:
            raise InvalidInput(
                f"discs = {count} find no room: after {index} the next fits in none of {TRIES:,} places; ask for "
                "fewer or smaller discs, a smaller gap, or a larger arena."
            )
    return Arena(x_max=layout.width, y_max=layout.height, discs=tuple(Disc(*place) for place in placed))


_BLOCK_RADIUS = (0.4, 1.1)
"""Smallest and largest radius of a block's circle [m]."""
_CORNERS = (3, 6)
"""Fewest and most corners of a convex block."""
_SHARE_OF_L = 0.4
"""Share of blocks that are L-shaped."""
_FILLED = 0.16
"""Share of the arena that the circles cover, about."""


def blocks(layout: Layout, rng: np.random.Generator) -> Arena:
    """As many as cover about a sixth of the arena, or as find room.

    Round obstacles that keep a gap from each other and from the walls do not part a rectangle, and neither do blocks
    inside them.

    Raises:
        InvalidInput: where not one of the smallest fits.
    """
    sides, least = (layout.width, layout.height), 2 * (_BLOCK_RADIUS[0] + layout.gap)
    require(
        min(sides) > least, "width, height", sides, f"more than {least:g} m each, a block with a gap on either side"
    )
    placed: list[tuple[float, float, float]] = []
    wanted, covered = _FILLED * layout.width * layout.height, 0.0
    most = min(_BLOCK_RADIUS[1], min(sides) / 2 - layout.gap)
    for _ in range(TRIES):
        if covered >= wanted:
            break
        radius = rng.uniform(_BLOCK_RADIUS[0], most)
        x, y = rng.uniform(radius + layout.gap, np.array(sides) - radius - layout.gap)
        if apart(placed, (x, y, radius), layout.gap):
            placed.append((float(x), float(y), float(radius)))
            covered += np.pi * radius**2
    return layout.arena([_block(place, rng) for place in placed])


def _block(place: tuple[float, float, float], rng: np.random.Generator) -> Polygon:
    x, y, radius = place
    turn = rng.uniform(0, 2 * np.pi)
    corners = _l_shape(rng) if rng.uniform() < _SHARE_OF_L else _convex(rng)
    directions = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    placed = np.array([x, y]) + radius * corners @ directions
    return Polygon(tuple((float(one), float(other)) for one, other in placed))


def _convex(rng: np.random.Generator) -> np.ndarray:
    """Corners on the unit circle, at angles that differ enough to see."""
    count = int(rng.integers(_CORNERS[0], _CORNERS[1] + 1))
    angles = 2 * np.pi * (np.arange(count) + rng.uniform(-0.25, 0.25, count)) / count
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _l_shape(rng: np.random.Generator) -> np.ndarray:
    """Two arms in the unit circle, whose inner corner is its middle."""
    arm = rng.uniform(0.35, 0.6)
    reach = np.sqrt(1 - arm**2)
    corners = [(-arm, -arm), (reach, -arm), (reach, 0.0), (0.0, 0.0), (0.0, reach), (-arm, reach)]
    return np.array(corners)
