"""Random arenas of long ways round: fences across the arena, and rooms along a corridor."""

import numpy as np

from apollonius.arenas.random.scattered import DOOR, Layout, Room, wall_pieces
from apollonius.game.arena import Arena

_THIN = 0.1
"""Thickness of these walls [m], at least; in a large arena as much as a chart surely has."""
_THIN_SHARE = 1 / 150
"""Least thickness as a share of the longer side."""
_BETWEEN = (1.2, 3.0)
"""Smallest and largest distance of two fences, in gaps."""
_SECOND = 0.15
"""Share of the fences with a second opening, and of the rooms with a door to the next one: these
make loops.
"""
_AT_AN_END = 0.8
"""Share of the fences whose opening is at an end."""


def fences(layout: Layout, rng: np.random.Generator) -> Arena:
    """Place thin walls across the arena, each with an opening or two; raises InvalidInput where not
    two lanes fit.
    """
    along_y = bool(rng.integers(2))
    long, wide = (layout.height, layout.width) if along_y else (layout.width, layout.height)
    gap, thin = layout.gap, _thickness(layout)
    layout.require_sides(3 * gap, "two lanes between fences with openings")
    walls: list[Room] = []
    at = gap * rng.uniform(*_BETWEEN)
    while at + thin + _BETWEEN[0] * gap <= long:
        lows = _openings(wide, gap, rng)
        walls += [(at, low, at + thin, high) for low, high in lows]
        at += thin + gap * rng.uniform(*_BETWEEN)
    return layout.with_walls(walls, along_y)


def _openings(wide: float, gap: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Return the pieces [m] of a fence, from end to end of each."""
    width = gap * rng.uniform(*DOOR)
    end = float(rng.integers(2)) * (wide - width)
    low = end if rng.uniform() < _AT_AN_END else rng.uniform(0, wide - width)
    lows = [low]
    if rng.uniform() < _SECOND:
        other = rng.uniform(0, wide - width)
        lows = sorted([low, other]) if abs(other - low) > 2 * width else lows
    return wall_pieces(0.0, lows, width, wide)


def floors(layout: Layout, rng: np.random.Generator) -> Arena:
    """Build rooms on both sides of a corridor, each with a door, some with one to the next.

    Raises InvalidInput where the arena is too small for them.
    """
    along_y = layout.height > layout.width
    long, wide = max(layout.width, layout.height), min(layout.width, layout.height)
    gap, thin = layout.gap, _thickness(layout)
    corridor = gap * rng.uniform(1.2, 1.8)
    layout.require_sides(6 * gap, "a corridor between rooms")
    middle = wide * rng.uniform(0.45, 0.55)
    walls: list[Room] = []
    sides = ((0.0, middle - corridor / 2 - thin), (middle + corridor / 2 + thin, wide))
    for side, (bottom, top) in enumerate(sides):
        low = (bottom - thin) if side else top
        left = 0.0
        while left < long:
            length = gap * rng.uniform(2.2, 4.5)
            right = long if long - (left + length) < 2.2 * gap + thin else left + length
            width = min(gap * rng.uniform(*DOOR), right - left - 0.02)
            door = left + rng.uniform(0, right - left - width)
            along = wall_pieces(left, [door], width, right)
            walls += [(start, low, end, low + thin) for start, end in along]
            if right < long:
                next_door = gap * rng.uniform(*DOOR)
                at = bottom + rng.uniform(0, top - bottom - next_door)
                openings = [at] if rng.uniform() < _SECOND else []
                across = wall_pieces(bottom, openings, next_door, top)
                walls += [(right, start, right + thin, end) for start, end in across]
                right += thin
            left = right
    return layout.with_walls(walls, along_y)


def _thickness(layout: Layout) -> float:
    return max(_THIN, _THIN_SHARE * max(layout.width, layout.height))
