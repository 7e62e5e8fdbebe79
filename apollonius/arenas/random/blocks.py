"""Convex and L-shaped blocks, turned at random, each in a circle of its own that keeps a gap from all others."""

import numpy as np

from apollonius.arenas.random.layout import TRIES, Layout, apart
from apollonius.errors import require
from apollonius.game.arena import Arena
from apollonius.game.polygon import Polygon

_RADIUS = (0.4, 1.1)
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
    sides, least = (layout.width, layout.height), 2 * (_RADIUS[0] + layout.gap)
    require(
        min(sides) > least, "width, height", sides, f"more than {least:g} m each, a block with a gap on either side"
    )
    placed: list[tuple[float, float, float]] = []
    wanted, covered = _FILLED * layout.width * layout.height, 0.0
    most = min(_RADIUS[1], min(sides) / 2 - layout.gap)
    for _ in range(TRIES):
        if covered >= wanted:
            break
        radius = rng.uniform(_RADIUS[0], most)
        x, y = rng.uniform(radius + layout.gap, np.array(sides) - radius - layout.gap)
        if apart(placed, (x, y, radius), layout.gap):
            placed.append((float(x), float(y), float(radius)))
            covered += np.pi * radius**2
    return layout.arena([_block(place, rng) for place in placed])


def _block(place: tuple[float, float, float], rng: np.random.Generator) -> Polygon:
    """One inside its circle."""
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
