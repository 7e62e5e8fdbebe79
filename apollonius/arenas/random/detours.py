"""Random arenas of long ways round: fences across the arena, and floors of rooms along a corridor."""

import numpy as np

from apollonius.arenas.random.scattered import Layout, Room
from apollonius.game.arena import Arena

_THIN = 0.1
"""Thickness of these walls [m], at least; in a large arena as much as a chart surely has."""
_THIN_SHARE = 1 / 150
"""Least thickness as a share of the longer side."""
_DOOR = (1.0, 1.5)
"""Smallest and largest width of an opening, in gaps."""
_BETWEEN = (1.2, 3.0)
"""Smallest and largest distance of two fences, in gaps."""
_SECOND = 0.15
"""Share of the fences with a second opening, and of the rooms with a door to the next one: these make loops."""
_AT_AN_END = 0.8
"""Share of the fences whose opening is at an end."""


def fences(layout: Layout, rng: np.random.Generator) -> Arena:
    """Place thin walls across the arena, each with an opening or two; raises InvalidInput where not two lanes fit."""
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
    return layout.walled(walls, along_y)


def _openings(wide: float, gap: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Return the pieces [m] of a fence, from end to end of each."""
    width = gap * rng.uniform(*_DOOR)
    end = float(rng.integers(2)) * (wide - width)
    low = end if rng.uniform() < _AT_AN_END else rng.uniform(0, wide - width)
    lows = [low]
    if rng.uniform() < _SECOND:
        other = rng.uniform(0, wide - width)
        lows = sorted([low, other]) if abs(other - low) > 2 * width else lows
    ends = [0.0, *[one for low in lows for one in (low, low + width)], wide]
    return [(low, high) for low, high in zip(ends[::2], ends[1::2], strict=True) if high - low > 1e-3]


def floors(layout: Layout, rng: np.random.Generator) -> Arena:
    """Build rooms on both sides of a corridor, each with a door, some with one to the next; errors as of `fences`."""
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
            width = min(gap * rng.uniform(*_DOOR), right - left - 0.02)
            door = left + rng.uniform(0, right - left - width)
            walls += [(left, low, door, low + thin), (door + width, low, right, low + thin)]
            if right < long:
                next_door = gap * rng.uniform(*_DOOR)
                at = bottom + rng.uniform(0, top - bottom - next_door)
                joined = rng.uniform() < _SECOND
                pieces = [(bottom, at), (at + next_door, top)] if joined else [(bottom, top)]
                walls += [(right, one, right + thin, other) for one, other in pieces]
                right += thin
            left = right
    walls = [wall for wall in walls if min(wall[2] - wall[0], wall[3] - wall[1]) > 1e-3]
    return layout.walled(walls, along_y)


def _thickness(layout: Layout) -> float:
    return max(_THIN, _THIN_SHARE * max(layout.width, layout.height))
