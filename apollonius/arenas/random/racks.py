"""A warehouse: rows of racks with aisles between them."""

import numpy as np

from apollonius.arenas.random.layout import Layout, rectangle
from apollonius.errors import require
from apollonius.game.arena import Arena

_DEEP = (0.5, 1.0)
"""Smallest and largest depth of a rack [m]."""
_LONG = (1.5, 4.0)
"""Shortest and longest rack [m]."""
_AISLE = (1.0, 1.6)
"""Smallest and largest width of an aisle, in gaps."""
_MISSING = 0.15
"""Share of the racks that are not there."""


def racks(layout: Layout, rng: np.random.Generator) -> Arena:
    """Rows along x, or along y, an aisle from the walls and from each other, each with aisles across.

    Raises:
        InvalidInput: where not one row fits.
    """
    along_y = bool(rng.integers(2))
    long, wide = (layout.height, layout.width) if along_y else (layout.width, layout.height)
    enough = f"at least {2 * layout.gap + _DEEP[0]:g} m each, a rack with an aisle on either side"
    sides = (layout.width, layout.height)
    require(min(sides) >= 2 * layout.gap + _DEEP[0], "width, height", sides, enough)
    aisle, depth = layout.gap * rng.uniform(*_AISLE), rng.uniform(*_DEEP)
    rows = max(1, int((wide - aisle) / (aisle + depth)))
    aisle = max(layout.gap, (wide - rows * depth) / (rows + 1))
    depth = (wide - (rows + 1) * aisle) / rows
    found = []
    for row in range(rows):
        bottom = aisle + row * (aisle + depth)
        at = layout.gap * rng.uniform(*_AISLE)
        while at + _DEEP[0] <= long - layout.gap:
            end = min(at + rng.uniform(*_LONG), long - layout.gap)
            if rng.uniform() >= _MISSING:
                found.append((at, bottom, end, bottom + depth))
            at = end + layout.gap * rng.uniform(*_AISLE)
    turned = [(one[1], one[0], one[3], one[2]) if along_y else one for one in found]
    return layout.arena([rectangle(*one) for one in turned])
