"""Rooms with doors: a rectangle parted by walls again and again, each with a door."""

import numpy as np

from apollonius.arenas.random.layout import WALL, Layout, rectangle
from apollonius.errors import require
from apollonius.game.arena import Arena
from apollonius.game.validation import MOST_POLYGONS

_LEAST = 2.4
"""How long a room's sides are at least, in gaps."""
_LARGE = 9.0
"""Rooms longer than this, in gaps, are always parted."""
_WHOLE = 0.15
"""Share of the others that could be parted and are not."""
_DOOR = (1.0, 1.5)
"""Smallest and largest width of a door, in gaps."""
_TRIES = 20
"""Places tried for a wall."""

Room = tuple[float, float, float, float]
"""Left, bottom, right, top [m]."""


def rooms(layout: Layout, rng: np.random.Generator) -> Arena:
    """Walls across the longer side of a room, if there is space for two; no wall ends at another one's door.

    Whatever is parted is joined by the door, so all rooms are. Two doors lead through a wall that is long enough, so
    that there are ways round. Parting ends once there are more walls than a game may have.

    Raises:
        InvalidInput: where there is no space for two rooms.
    """
    sides, least = (layout.width, layout.height), 2 * _LEAST * layout.gap + WALL
    enough = f"{least:g} m and more for one side, two rooms, and {_LEAST * layout.gap:g} m for the other"
    require(max(sides) >= least and min(sides) >= _LEAST * layout.gap, "width, height", sides, enough)
    walls: list[Room] = []
    doors: list[Room] = []
    waiting: list[Room] = [(0.0, 0.0, layout.width, layout.height)]
    while waiting and len(walls) <= MOST_POLYGONS:
        room = waiting.pop()
        whole = walls and max(room[2] - room[0], room[3] - room[1]) < _LARGE * layout.gap and rng.uniform() < _WHOLE
        parted = None if whole else _part(room, doors, layout.gap, rng)
        if parted is None:
            continue
        pieces, openings, halves = parted
        walls += pieces
        doors += openings
        waiting += halves
    return layout.arena([rectangle(*wall) for wall in walls])


def _part(
    room: Room, doors: list[Room], gap: float, rng: np.random.Generator
) -> tuple[list[Room], list[Room], list[Room]] | None:
    """The pieces of a wall through a room, its doors and the two rooms; None where it stays whole."""
    left, bottom, right, top = room
    across = right - left >= top - bottom  # the wall runs along y
    if not across:
        turned = _part((bottom, left, top, right), [_turn(door) for door in doors], gap, rng)
        return turned and tuple([_turn(one) for one in part] for part in turned)  # pyright: ignore[reportReturnType]
    least = _LEAST * gap
    if right - left < 2 * least + WALL or top - bottom < least:
        return None
    for _ in range(_TRIES):
        x = rng.uniform(left + least, right - least - WALL)
        in_the_way = any(
            door[0] < x + WALL + gap / 2
            and x - gap / 2 < door[2]
            and (abs(door[3] - bottom) < 2 * WALL or abs(door[1] - top) < 2 * WALL)
            for door in doors
        )
        if not in_the_way:
            break
    else:
        return None
    width = gap * rng.uniform(*_DOOR)
    long = top - bottom
    count = 2 if long > 4 * least else 1
    span = long / count
    lows = [bottom + number * span + rng.uniform(0, span - width) for number in range(count)]
    openings: list[Room] = [(x, low, x + WALL, low + width) for low in lows]
    ends = [bottom, *[end for low in lows for end in (low, low + width)], top]
    pieces = [(x, low, x + WALL, high) for low, high in zip(ends[::2], ends[1::2], strict=True) if high - low > 1e-3]
    return pieces, openings, [(left, bottom, x, top), (x + WALL, bottom, right, top)]


def _turn(room: Room) -> Room:
    """x and y exchanged."""
    left, bottom, right, top = room
    return bottom, left, top, right
