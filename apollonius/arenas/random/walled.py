"""Arenas parted by walls: mazes, rooms with doors, and racks with aisles between them."""

import numpy as np

from apollonius.arenas.random.scattered import DOOR, WALL, Layout, Room, transpose_room, wall_pieces
from apollonius.game.arena import MOST_POLYGONS, Arena
from apollonius.io.errors import require

_WIDER = 1.25
"""Width of a corridor, in gaps."""
_OPENED = 0.35
"""Share of the tree's walls that are taken out: in a maze without loops nobody escapes."""
_FEW_OPENED = 0.04
"""That share in a labyrinth."""


def labyrinth(layout: Layout, rng: np.random.Generator) -> Arena:
    """Build a maze of long ways and dead ends, with few loops; raises InvalidInput as `maze`
    does.
    """
    return maze(layout, rng, _FEW_OPENED)


def maze(layout: Layout, rng: np.random.Generator, opened: float = _OPENED) -> Arena:
    """Build a maze of as many cells as fit, of whose tree a share of the walls is taken out; raises
    InvalidInput where fewer than two by two fit.
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
    upright = _walls(right, wide, high, layout.height)
    level = _walls(up.T, high, wide, layout.width)
    return layout.with_walls([*upright, *map(transpose_room, level)])


def _carve(right: np.ndarray, up: np.ndarray, rng: np.random.Generator) -> None:
    """Take out walls until every cell can be reached by one path: a depth-first walk at random."""
    columns, rows = up.shape[0], right.shape[1]
    path, visited = [(0, 0)], {(0, 0)}
    while path:
        x, y = path[-1]
        beside = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        inside = [cell for cell in beside if 0 <= cell[0] < columns and 0 <= cell[1] < rows]
        new = [cell for cell in inside if cell not in visited]
        if not new:
            path.pop()
            continue
        to = new[rng.integers(len(new))]
        if to[1] == y:
            right[min(x, to[0]), y] = False
        else:
            up[x, min(y, to[1])] = False
        visited.add(to)
        path.append(to)


def _runs(walls: np.ndarray) -> list[tuple[int, int]]:
    """Return the first and last index of each row of walls, one long wall."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], walls.astype(int), [0]])))
    return [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def _walls(lines: np.ndarray, spacing: float, cell: float, long: float) -> list[Room]:
    """Return the walls on lines along y, of cells each, which end in the middle of the walls they
    meet, which leaves no slit, but inside the arena; lines are some metres apart, cells and the
    arena as long as given [m].
    """
    half = WALL / 2
    return [
        (x - half, max(first * cell - half, 0.0), x + half, min(last * cell + half, long))
        for x, line in zip(spacing * np.arange(1, len(lines) + 1), lines, strict=True)
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
    """Place rows of racks along x, or along y, with aisles around and across; raises InvalidInput
    where no row fits.
    """
    along_y = bool(rng.integers(2))
    long, wide = (layout.height, layout.width) if along_y else (layout.width, layout.height)
    layout.require_sides(2 * layout.gap + _DEEP[0], "a rack with an aisle on either side")
    aisle, depth = layout.gap * rng.uniform(*_AISLE), rng.uniform(*_DEEP)
    rows = max(1, int((wide - aisle) / (aisle + depth)))
    aisle = max(layout.gap, (wide - rows * depth) / (rows + 1))
    depth = (wide - (rows + 1) * aisle) / rows
    wall_rooms = []
    for row in range(rows):
        bottom = aisle + row * (aisle + depth)
        at = layout.gap * rng.uniform(*_AISLE)
        while at + _DEEP[0] <= long - layout.gap:
            end = min(at + rng.uniform(*_LONG), long - layout.gap)
            if rng.uniform() >= _MISSING:
                wall_rooms.append((at, bottom, end, bottom + depth))
            at = end + layout.gap * rng.uniform(*_AISLE)
    return layout.with_walls(wall_rooms, along_y)


_LEAST = 2.4
"""Least length of a room's sides, in gaps."""
_LARGE = 9.0
"""Rooms longer than this, in gaps, are always parted."""
_WHOLE = 0.15
"""Share of the others that could be parted and are not."""
_TRIES = 20
"""Positions tried for a wall."""


def rooms(layout: Layout, rng: np.random.Generator) -> Arena:
    """Part rooms across their longer sides while there is space; no wall ends at another one's
    door.

    A door joins the parts, so all rooms are joined. Two doors lead through a long wall, which makes
    loops. Parting ends beyond the number of walls that a game may have. Raises InvalidInput where
    there is no space for two rooms.
    """
    sides, least = (layout.width, layout.height), 2 * _LEAST * layout.gap + WALL
    shorter = f"{_LEAST * layout.gap:g} m for the other"
    bound = f"{least:g} m and more for one side, two rooms, and {shorter}"
    require(
        max(sides) >= least and min(sides) >= _LEAST * layout.gap, "width, height", sides, bound
    )
    walls: list[Room] = []
    doors: list[Room] = []
    waiting: list[Room] = [(0.0, 0.0, layout.width, layout.height)]
    while waiting and len(walls) <= MOST_POLYGONS:
        room = waiting.pop()
        whole = (
            walls
            and max(room[2] - room[0], room[3] - room[1]) < _LARGE * layout.gap
            and rng.uniform() < _WHOLE
        )
        parted = None if whole else _split_room(room, doors, layout.gap, rng)
        if parted is None:
            continue
        for collected, new in zip((walls, doors, waiting), parted, strict=True):
            collected += new
    return layout.with_walls(walls)


def _split_room(
    room: Room, doors: list[Room], gap: float, rng: np.random.Generator
) -> tuple[list[Room], list[Room], list[Room]] | None:
    """Return the pieces of a wall through a room, its doors and the two rooms; None where it stays
    whole.
    """
    left, bottom, right, top = room
    across = right - left >= top - bottom  # the wall runs along y
    if not across:
        other_way = _split_room(
            (bottom, left, top, right), [transpose_room(door) for door in doors], gap, rng
        )
        if other_way is None:
            return None
        wall, first_doors, rooms = ([transpose_room(room) for room in part] for part in other_way)
        return wall, first_doors, rooms
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
    walls: list[Room] = [
        (x, low, x + WALL, high) for low, high in wall_pieces(bottom, lows, width, top)
    ]
    return walls, openings, [(left, bottom, x, top), (x + WALL, bottom, right, top)]
