"""Discs of random places and sizes."""

import numpy as np

from apollonius.arenas.random.layout import TRIES, Layout, apart
from apollonius.errors import InvalidInput, require
from apollonius.game.arena import Arena, Disc
from apollonius.limits import DISCS

_RADIUS = (0.3, 0.8)
"""Smallest and largest radius of a disc [m], unless another is asked for."""
_PER_AREA = 0.05
"""Discs on each square metre where nobody says how many."""


def discs(
    layout: Layout, rng: np.random.Generator, count: int | None = None, radius: tuple[float, float] = _RADIUS
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
