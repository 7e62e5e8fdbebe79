"""Where robots can be: the largest part, and which obstacles are islands in it."""

import numpy as np
import pytest

from apollonius.arenas.free_space import free_space, largest_part, tile
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.solve.enough import core

SQUARE = Polygon(((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)))
DISCS = Disc(7.0, 7.0, 1.0), Disc(7.0, 4.7, 1.0), Disc(10.0, 2.0, 1.0)
"""Two with 0.3 m between them, one that stands against a wall."""


def game(radius):
    return Game(
        arena=Arena(discs=DISCS, polygons=(SQUARE,)), pursuer=Unicycle(radius=radius), evader=Unicycle(radius=0.05)
    )


def test_islands_are_obstacles_with_free_space_around_them_for_the_larger_robot():
    narrow, wide = free_space(game(0.2)), free_space(game(0.0))
    assert (narrow.islands, wide.islands) == (2, 3)
    assert wide.area > narrow.area


def test_only_the_largest_part_is_kept():
    free = np.ones((20, 30), bool)
    free[:, 10] = False
    free[5, 20] = False
    space = largest_part(free, 1.0, 2.0, 0.5)
    assert space.parts == 2
    assert not space.free[:, :11].any()
    assert space.area == (20 * 19 - 1) * 0.25
    assert space.islands == 1


def test_places_that_touch_at_a_corner_are_apart_and_obstacles_that_do_are_not():
    free = np.zeros((8, 8), bool)
    free[:4, :4] = free[4:, 4:] = True
    assert largest_part(free, 0.0, 0.0, 1.0).parts == 2
    free = np.ones((8, 8), bool)
    free[2, 2] = free[3, 3] = False
    assert largest_part(free, 0.0, 0.0, 1.0).islands == 1


SIDE = 120
SPIRAL = np.zeros((SIDE, SIDE), bool)
"""A corridor of 6 places that winds inwards, with walls of 4."""
for number in range(6):
    low, high = 10 * number, SIDE - 10 * number
    SPIRAL[low : low + 6, max(0, low - 10) : high] = True
    SPIRAL[low:high, high - 6 : high] = True
    SPIRAL[high - 6 : high, low:high] = True
    SPIRAL[low + 10 : high, low : low + 6] = True
ROOM = np.ones((SIDE, SIDE), bool)
BENT = ROOM.copy()
BENT[30:, 40:70] = False
y, x = np.mgrid[:SIDE, :SIDE] - SIDE / 2
ANNULUS = (np.hypot(x, y) < 55) & (np.hypot(x, y) > 25)


def tiled(free, spacing, angle):
    return tile(largest_part(free, 0.0, 0.0, 1.0), spacing, angle)


@pytest.mark.parametrize(("spacing", "angle"), [(7.0, 0.3), (25.0, 0.0), (11.0, np.pi / 6)])
@pytest.mark.parametrize("free", [BENT, SPIRAL], ids=["bent room", "spiral"])
def test_without_islands_one_pursuer_is_enough_whatever_the_cells(free, spacing, angle):
    tiling = tiled(free, spacing, angle)
    assert tiling.holes == 0
    assert len(core(tiling.adjacency)) == 1


@pytest.mark.parametrize("angle", [0.0, np.pi / 6])
@pytest.mark.parametrize("spacing", [6.0, 12.0])
def test_the_core_round_an_island_is_a_cycle(spacing, angle):
    tiling = tiled(ANNULUS, spacing, angle)
    kept = core(tiling.adjacency)
    assert tiling.holes == 1
    assert len(kept) >= 2 * np.pi * 25 / spacing
    assert (tiling.adjacency[np.ix_(kept, kept)].sum(axis=1) == 2).all()


def test_a_thin_wall_through_a_cell_parts_it():
    free = ROOM.copy()
    free[:, 60] = False
    free[:3, 60] = True
    tiling = tiled(free, 40.0, 0.0)
    assert tiling.holes == 0
    across = [
        (tiling.places[i], tiling.places[j])
        for i, j in np.argwhere(np.triu(tiling.adjacency))
        if (tiling.places[i][0] < 60) != (tiling.places[j][0] < 60)
    ]
    assert all(min(one[1], other[1]) < 40 for one, other in across)
