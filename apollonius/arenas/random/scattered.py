"""The layout of random arenas; and scattered obstacles, discs or blocks, that keep a gap."""

from dataclasses import dataclass

import numpy as np

from apollonius.game.arena import MOST_DISCS, Arena, Disc
from apollonius.game.polygon import Polygon
from apollonius.io.errors import InvalidInput, require

WALL = 0.2
"""Thickness of a wall inside an arena [m]."""
TRIES = 2000
"""Positions that are tried."""


Room = tuple[float, float, float, float]
"""Left, bottom, right, top [m]."""


def transpose_room(room: Room) -> Room:
    """Return a room with x and y exchanged."""
    left, bottom, right, top = room
    return bottom, left, top, right


def wall_pieces(
    low: float, openings: list[float], width: float, high: float
) -> list[tuple[float, float]]:
    """Return the start and end of each piece of a wall with openings [m].

    Args:
        low, high: ends of the wall [m].
        openings: where each opening begins [m].
        width: width of the openings [m].
    """
    ends = [low, *[end for opening in openings for end in (opening, opening + width)], high]
    pairs = zip(ends[::2], ends[1::2], strict=True)
    return [(start, end) for start, end in pairs if end - start > 1e-3]


DOOR = (1.0, 1.5)
"""Smallest and largest width of an opening in a wall, in gaps."""


@dataclass(frozen=True)
class Layout:
    """The size of an arena with a corner at the origin, and the least width of its passages [m]."""

    width: float
    height: float
    gap: float

    def require_sides(self, least: float, what: str) -> None:
        """Refuse sides shorter than this [m], by what they must have room for."""
        sides = (self.width, self.height)
        require(min(sides) >= least, "width, height", sides, f"at least {least:g} m each, {what}")

    def arena(self, polygons: list[Polygon]) -> Arena:
        return Arena(x_max=self.width, y_max=self.height, polygons=tuple(polygons))

    def with_walls(self, walls: list[Room], along_y: bool = False) -> Arena:
        """Return the arena with these walls, turned where they were laid out along y."""
        rectangles = [transpose_room(wall) if along_y else wall for wall in walls]
        polygons = [
            Polygon(((x, y), (x_to, y), (x_to, y_to), (x, y_to))) for x, y, x_to, y_to in rectangles
        ]
        return self.arena(polygons)


Circle = tuple[float, float, float]
"""x, y and radius [m]."""


def _try_circle(
    layout: Layout, rng: np.random.Generator, least: float, most: float, placed: list[Circle]
) -> Circle | None:
    """Draw a circle with a radius [m] from `least` to `most`; None unless it keeps the gap from all
    others.
    """
    radius = rng.uniform(least, most)
    margin = radius + layout.gap
    x, y = rng.uniform(margin, np.array([layout.width, layout.height]) - margin)
    if any(np.hypot(x - x_, y - y_) < radius + size + layout.gap for x_, y_, size in placed):
        return None
    return float(x), float(y), float(radius)


_DISC_RADIUS = (0.3, 0.8)
"""Smallest and largest radius of a disc [m]."""
_PER_AREA = 0.05
"""Discs on each square metre, up to the most that an arena can have."""


def discs(layout: Layout, rng: np.random.Generator) -> Arena:
    """Place discs that keep the gap from each other and from the walls.

    Every robot of a diameter below the gap can go from any free place to any other: discs grown by
    its radius touch neither each other nor the walls, and separate round obstacles do not cut a
    rectangle in parts. Raises InvalidInput for discs that do not fit.
    """
    least, most = _DISC_RADIUS
    count = min(round(_PER_AREA * layout.width * layout.height), MOST_DISCS)
    layout.require_sides(2 * (most + layout.gap), "the largest disc with a gap on either side")
    placed: list[Circle] = []
    for index in range(count):
        for _ in range(TRIES):
            circle = _try_circle(layout, rng, least, most, placed)
            if circle:
                placed.append(circle)
                break
        else:
            raise InvalidInput(
                f"{count} discs find no room: "
                f"after {index} the next fits in none of {TRIES:,} places; ask for a "
                "smaller gap, or a larger arena."
            )
    return Arena(
        x_max=layout.width, y_max=layout.height, discs=tuple(Disc(*place) for place in placed)
    )


_BLOCK_RADIUS = (0.4, 1.1)
"""Smallest and largest radius of a block's circle [m]."""
_CORNERS = (3, 6)
"""Fewest and most corners of a convex block."""
_SHARE_OF_L = 0.4
"""Share of blocks that are L-shaped."""
_FILLED = 0.16
"""Share of the arena that the circles cover, about."""


def blocks(layout: Layout, rng: np.random.Generator) -> Arena:
    """Place blocks until they cover about a sixth of the arena, or no more fits.

    Round obstacles that keep a gap from each other and from the walls do not part a rectangle, and
    neither do blocks inside them. Raises InvalidInput where not one of the smallest fits.
    """
    layout.require_sides(2 * (_BLOCK_RADIUS[0] + layout.gap), "a block with a gap on either side")
    placed: list[Circle] = []
    wanted, covered = _FILLED * layout.width * layout.height, 0.0
    most = min(_BLOCK_RADIUS[1], min(layout.width, layout.height) / 2 - layout.gap)
    for _ in range(TRIES):
        if covered >= wanted:
            break
        circle = _try_circle(layout, rng, _BLOCK_RADIUS[0], most, placed)
        if circle:
            placed.append(circle)
            covered += np.pi * circle[2] ** 2
    return layout.arena([_block(place, rng) for place in placed])


def _block(place: Circle, rng: np.random.Generator) -> Polygon:
    x, y, radius = place
    turn = rng.uniform(0, 2 * np.pi)
    corners = _l_shape(rng) if rng.uniform() < _SHARE_OF_L else _convex(rng)
    directions = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    placed = np.array([x, y]) + radius * corners @ directions
    return Polygon(tuple((float(x), float(y)) for x, y in placed))


def _convex(rng: np.random.Generator) -> np.ndarray:
    """Return corners on the unit circle, at angles that differ enough to see."""
    count = int(rng.integers(_CORNERS[0], _CORNERS[1] + 1))
    angles = 2 * np.pi * (np.arange(count) + rng.uniform(-0.25, 0.25, count)) / count
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _l_shape(rng: np.random.Generator) -> np.ndarray:
    """Return an L in the unit circle, whose inner corner is the middle."""
    arm = rng.uniform(0.35, 0.6)
    reach = np.sqrt(1 - arm**2)
    corners = [(-arm, -arm), (reach, -arm), (reach, 0.0), (0.0, 0.0), (0.0, reach), (-arm, reach)]
    return np.array(corners)
