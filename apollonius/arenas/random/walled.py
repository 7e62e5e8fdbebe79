"""Arenas parted by walls: mazes, rooms with doors, racks with aisles between them, fences across, floors of rooms."""

import numpy as np

from apollonius.arenas.random.scattered import DOOR, WALL, Layout, Room, pieces, turned
from apollonius.game.arena import MOST_POLYGONS, Arena
from apollonius.io.errors import require

_WIDER = 1.25
"""Width of a corridor, in gaps."""
_OPENED = 0.35
"""Share of the tree's walls that are taken out: in a maze without loops nobody escapes."""
_FEW_OPENED = 0.04
"""That share in a labyrinth."""


def labyrinth(layout: Layout, rng: np.random.Generator) -> Arena:
    """Build a maze of long ways and dead ends, with few loops; errors as those of `maze`."""
    return maze(layout, rng, _FEW_OPENED)


def maze(layout: Layout, rng: np.random.Generator, opened: float = _OPENED) -> Arena:
    """Build a maze of as many cells as fit, of whose tree a share of the walls is taken out; raises InvalidInput where
    fewer than two by two fit.
    """
    pitch = _WIDER * layout.gap + WALL
    columns, rows = (int((side + WALL) / pitch) for side in (layout.width, layout.height))
    layout.require_sides(2 * pitch - WALL, "two corridors with a wall between")
    # A wall stands between a cell and its right neighbour, and between it and its upper one.
    right, up = np.ones((columns - 1, rows), bool), np.ones((columns, rows - 1), bool)
    _carve(right, up, rng)
    right &= rng.uniform(size=right.shape) >= opened
    up &= rng.uniform(size=up.shape) >= opened
    wide, high = layout.width / columns, layout.height / rows
    upright, level = _walls(right, wide, high, layout.height), _walls(up.T, high, wide, layout.width)
    return layout.walled([*upright, *map(turned, level)])


def _carve(right: np.ndarray, up: np.ndarray, rng: np.random.Generator) -> None:
    """Take out walls until every cell can be reached by one path: a depth-first walk at random."""
    columns, rows = up.shape[0], right.shape[1]
    way, seen = [(0, 0)], {(0, 0)}
    while way:
        x, y = way[-1]
        beside = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        new = [one for one in beside if 0 <= one[0] < columns and 0 <= one[1] < rows and one not in seen]
        if not new:
            way.pop()
            continue
        to = new[rng.integers(len(new))]
        if to[1] == y:
            right[min(x, to[0]), y] = False
        else:
            up[x, min(y, to[1])] = False
        seen.add(to)
        way.append(to)


def _runs(walls: np.ndarray) -> list[tuple[int, int]]:
    """Return the first and last index of each row of walls, one long wall."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], walls.astype(int), [0]])))
    return [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def _walls(lines: np.ndarray, apart: float, cell: float, long: float) -> list[Room]:
    """Return the walls on lines along y, of cells each, which end in the middle of the walls they meet, which leaves no
    slit, but inside the arena; lines are some metres apart, cells and the arena as long as given [m].
    """
    half = WALL / 2
    return [
        (x - half, max(first * cell - half, 0.0), x + half, min(last * cell + half, long))
        for x, line in zip(apart * np.arange(1, len(lines) + 1), lines, strict=True)
        for first, last in _runs(line)
    ]


_DEEP = (0.5, 1.0)
"""Smallest and largest depth of a rack [m]."""
_LONG = (1.5, 4.0)
"""Shortest and longest rack [m]."""
_AISLE = (1.0, 1.6)
"""Smallest and largest width of an aisle, in gaps."""
_MISSING = 0.15
"""Share of the racks that are not there."""


def racks(layout: Layout, rng: np.random.Generator) -> Arena:
    """Place rows of racks along x, or along y, with aisles around and across; raises InvalidInput where no row fits."""
    along_y = bool(rng.integers(2))
    long, wide = (layout.height, layout.width) if along_y else (layout.width, layout.height)
    layout.require_sides(2 * layout.gap + _DEEP[0], "a rack with an aisle on either side")
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
    return layout.walled(found, along_y)


_LEAST = 2.4
"""Least length of a room's sides, in gaps."""
_LARGE = 9.0
"""Rooms longer than this, in gaps, are always parted."""
_WHOLE = 0.15
"""Share of the others that could be parted and are not."""
_TRIES = 20
"""Positions tried for a wall."""


def rooms(layout: Layout, rng: np.random.Generator) -> Arena:
    """Part rooms across their longer sides while there is space; no wall ends at another one's door.

    A door joins the parts, so all rooms are joined. Two doors lead through a long wall, which makes loops. Parting ends
    beyond the number of walls that a game may have. Raises InvalidInput where there is no space for two rooms.
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
        for known, new in zip((walls, doors, waiting), parted, strict=True):
            known += new
    return layout.walled(walls)


def _part(
    room: Room, doors: list[Room], gap: float, rng: np.random.Generator
) -> tuple[list[Room], list[Room], list[Room]] | None:
    """Return the pieces of a wall through a room, its doors and the two rooms; None where it stays whole."""
    left, bottom, right, top = room
    across = right - left >= top - bottom  # the wall runs along y
    if not across:
        other_way = _part((bottom, left, top, right), [turned(door) for door in doors], gap, rng)
        return other_way and tuple([turned(one) for one in part] for part in other_way)  # pyright: ignore[reportReturnType]
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
    width = gap * rng.uniform(*DOOR)
    long = top - bottom
    count = 2 if long > 4 * least else 1
    span = long / count
    lows = [bottom + number * span + rng.uniform(0, span - width) for number in range(count)]
    openings: list[Room] = [(x, low, x + WALL, low + width) for low in lows]
    walls: list[Room] = [(x, low, x + WALL, high) for low, high in pieces(bottom, lows, width, top)]
    return walls, openings, [(left, bottom, x, top), (x + WALL, bottom, right, top)]


_THIN = 0.1
"""Thickness of these walls [m], at least; in a large arena as much as a chart surely has."""
_THIN_SHARE = 1 / 150
"""Least thickness as a share of the longer side."""
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
    width = gap * rng.uniform(*DOOR)
    end = float(rng.integers(2)) * (wide - width)
    low = end if rng.uniform() < _AT_AN_END else rng.uniform(0, wide - width)
    lows = [low]
    if rng.uniform() < _SECOND:
        other = rng.uniform(0, wide - width)
        lows = sorted([low, other]) if abs(other - low) > 2 * width else lows
    return pieces(0.0, lows, width, wide)


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
            width = min(gap * rng.uniform(*DOOR), right - left - 0.02)
            door = left + rng.uniform(0, right - left - width)
            walls += [(start, low, end, low + thin) for start, end in pieces(left, [door], width, right)]
            if right < long:
                next_door = gap * rng.uniform(*DOOR)
                at = bottom + rng.uniform(0, top - bottom - next_door)
                openings = [at] if rng.uniform() < _SECOND else []
                walls += [(right, one, right + thin, other) for one, other in pieces(bottom, openings, next_door, top)]
                right += thin
            left = right
    return layout.walled(walls, along_y)


def _thickness(layout: Layout) -> float:
    return max(_THIN, _THIN_SHARE * max(layout.width, layout.height))
