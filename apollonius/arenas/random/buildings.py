"""Random floors of buildings: corridors, rooms on both sides, doors and furniture.

Measures are those of offices: rooms 3 to 7 m wide, corridors of 1.75 to 2.5 m, desks of 1.6 by 0.8
m, shelves 0.4 m deep (Neufert, "Architects' Data"); doors of 0.8 to 1.2 m, of which the narrowest
let a wheelchair pass (ADA Standards for Accessible Design, 404.2.3). Corridors branch off
corridors, as on floors of a campus (Whiting, "Geometric, topological and semantic analysis of
multi-building floor plan data", 2006).
"""

import itertools
from typing import NamedTuple

import numpy as np

from apollonius.arenas.random.scattered import Layout, Room, transpose_room, wall_pieces
from apollonius.game.arena import Arena

_WALL = 0.15
"""Thickness of walls [m]."""
_CORRIDOR = (1.75, 2.5)
"""Narrowest and widest corridor [m]."""
_ROOM = (3.0, 7.0)
"""Narrowest and widest room along its corridor [m]."""
_DEEP = 8.5
"""Depth [m] from which on a corridor fits between two rooms."""
_DOOR = (0.8, 1.2)
"""Narrowest and widest door [m]."""
_NEXT = 0.2
"""Share of rooms with a door to the next one: these make loops."""
_FURNITURE = ((1.6, 0.8), (1.6, 0.8), (0.9, 0.4), (1.8, 0.4), (2.4, 1.0), (0.6, 0.6), (2.0, 0.9))
"""Lengths and depths of desks, shelves, a table, a cupboard and a sofa [m]."""
_PER_AREA = 0.12
"""Pieces of furniture on each square metre of a room."""
_AT_A_WALL = 0.7
"""Share of pieces that stand at a wall."""
_TRIES = 12
"""Places that are tried for a piece."""
_LEAST = 12.0
"""Shortest side of a building [m]."""


class _Block(NamedTuple):
    """A part of the floor without corridors, and on which of its sides there is one: left, bottom,
    right, top, in the order of `Room`.
    """

    room: Room
    corridors: tuple[bool, bool, bool, bool]

    def transposed(self) -> "_Block":
        """The block with x and y exchanged."""
        left, bottom, right, top = self.corridors
        return _Block(transpose_room(self.room), (bottom, left, top, right))


def buildings(layout: Layout, rng: np.random.Generator) -> Arena:
    """Build the floor of a building; raises InvalidInput for less than 12 m along a side."""
    layout.require_sides(_LEAST, "a corridor between rooms")
    along_x = layout.width >= layout.height
    floor = _Block((0.0, 0.0, layout.width, layout.height), (False, False, False, False))
    blocks = _split(floor, rng) if along_x else _split_across(floor, rng)
    walls = [wall for block in blocks for wall in _furnish(block, layout, rng)]
    return layout.with_walls([_inside(layout, *wall) for wall in walls])


def _inside(layout: Layout, left: float, bottom: float, right: float, top: float) -> Room:
    """Return the part of a wall inside the building."""
    return max(left, 0.0), max(bottom, 0.0), min(right, layout.width), min(top, layout.height)


def _split(block: _Block, rng: np.random.Generator) -> list[_Block]:
    """Run a corridor along x through a block, and others off it through both its halves, as long as
    they fit.
    """
    left, bottom, right, top = block.room
    if top - bottom < _DEEP:
        return [block]
    corridor = rng.uniform(*_CORRIDOR)
    middle = bottom + (top - bottom) * rng.uniform(0.45, 0.55)
    at_left, at_bottom, at_right, at_top = block.corridors
    lower_half = (left, bottom, right, middle - corridor / 2)
    upper_half = (left, middle + corridor / 2, right, top)
    lower = _Block(lower_half, (at_left, at_bottom, at_right, True))
    upper = _Block(upper_half, (at_left, True, at_right, at_top))
    return [part for half in (lower, upper) for part in _split_across(half, rng)]


def _split_across(block: _Block, rng: np.random.Generator) -> list[_Block]:
    """Split a block by a corridor along y, unless its rooms need none."""
    if any(block.corridors) and not _is_deep(block):
        return [block]
    return [part.transposed() for part in _split(block.transposed(), rng)]


def _is_deep(block: _Block) -> bool:
    """Check whether a corridor fits between two rooms off the longest corridor at a block."""
    left, bottom, right, top = block.room
    return (top - bottom if _front(block) % 2 else right - left) >= _DEEP


def _front(block: _Block) -> int:
    """Return the side of a block with the longest corridor, in the order of `Room`."""
    left, bottom, right, top = block.room
    lengths = (top - bottom, right - left, top - bottom, right - left)
    return int(np.argmax(np.where(block.corridors, lengths, 0.0)))


def _furnish(block: _Block, layout: Layout, rng: np.random.Generator) -> list[Room]:
    """Build the rooms of a block side by side along its longest corridor, and furnish them."""
    front = _front(block)
    if front % 2 == 0:
        return [transpose_room(wall) for wall in _furnish(block.transposed(), layout, rng)]
    left, bottom, right, top = block.room
    at_left, _, at_right, _ = block.corridors
    front_y, back_y = (bottom, top) if front == 1 else (top, bottom)
    ends = _room_ends(left, right, rng)
    walls = [_upright(left, bottom, top)] if at_left else []
    walls += [_upright(right, bottom, top)] if at_right else []
    walls += [_level(back_y, left, right)] if block.corridors[(front + 2) % 4] else []
    doors: list[Room] = []
    for start, end in itertools.pairwise(ends):
        low, high = _opening(start, end, layout.gap, rng)
        walls += [_level(front_y, *piece) for piece in wall_pieces(start, [low], high - low, end)]
        doors.append(_level(front_y, low, high))
    for x in ends[1:-1]:
        low, high = _opening(bottom, top, layout.gap, rng)
        is_open = rng.uniform() < _NEXT
        pieces = wall_pieces(bottom, [low] if is_open else [], high - low, top)
        walls += [_upright(x, *piece) for piece in pieces]
        doors += [_upright(x, low, high)] if is_open else []
    rooms = [(start, bottom, end, top) for start, end in itertools.pairwise(ends)]
    return walls + [piece for room in rooms for piece in _furniture(room, doors, layout.gap, rng)]


def _room_ends(left: float, right: float, rng: np.random.Generator) -> list[float]:
    """Return the ends of rooms that stand side by side between two places [m]."""
    ends = [left]
    while right - ends[-1] > 2 * _ROOM[0]:
        ends.append(min(ends[-1] + rng.uniform(*_ROOM), right - _ROOM[0]))
    return [*ends, right]


def _level(y: float, start: float, end: float) -> Room:
    """Return the piece of a wall along x."""
    return start - _WALL / 2, y - _WALL / 2, end + _WALL / 2, y + _WALL / 2


def _upright(x: float, start: float, end: float) -> Room:
    """Return the piece of a wall along y."""
    return transpose_room(_level(x, start, end))


def _opening(start: float, end: float, gap: float, rng: np.random.Generator) -> tuple[float, float]:
    """Return the ends of the gap between pieces of a wall [m] that leave room for a door."""
    width = max(gap, rng.uniform(*_DOOR)) + _WALL
    low = rng.uniform(start + _WALL, end - _WALL - width)
    return float(low), float(low + width)


def _furniture(room: Room, doors: list[Room], gap: float, rng: np.random.Generator) -> list[Room]:
    """Place furniture in a room, each piece at a wall or the gap away from it, and the gap away
    from all other pieces and from doors.
    """
    left, bottom, right, top = room
    inside = (left + _WALL / 2, bottom + _WALL / 2, right - _WALL / 2, top - _WALL / 2)
    placed: list[Room] = []
    for _ in range(round(_PER_AREA * (right - left) * (top - bottom))):
        for _ in range(_TRIES):
            piece = _piece(inside, gap, rng)
            if piece and not any(_is_near(piece, other, gap) for other in placed + doors):
                placed.append(piece)
                break
    return placed


def _piece(inside: Room, gap: float, rng: np.random.Generator) -> Room | None:
    """Draw a piece of furniture in a room; None if it does not keep the gap from a wall at which it
    does not stand.
    """
    left, bottom, right, top = inside
    length, depth = _FURNITURE[rng.integers(len(_FURNITURE))]
    is_turned = bool(rng.integers(2))
    wide, high = (depth, length) if is_turned else (length, depth)
    places = rng.uniform(size=2)
    if rng.uniform() < _AT_A_WALL:  # with its long side
        places[0 if is_turned else 1] = rng.integers(2)
    x = left + places[0] * (right - left - wide)
    y = bottom + places[1] * (top - bottom - high)
    distances = (x - left, y - bottom, right - x - wide, top - y - high)
    fits = all(distance < 1e-6 or distance >= gap for distance in distances)
    return (float(x), float(y), float(x + wide), float(y + high)) if fits else None


def _is_near(piece: Room, other: Room, gap: float) -> bool:
    """Check whether two rectangles are less than the gap apart."""
    across = max(other[0] - piece[2], piece[0] - other[2], 0.0)
    upwards = max(other[1] - piece[3], piece[1] - other[3], 0.0)
    return bool(np.hypot(across, upwards) < gap)
