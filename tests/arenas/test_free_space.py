"""Where robots can be: the largest part, and which obstacles are islands in it."""

import numpy as np
import pytest

from apollonius.arenas import free_space as module
from apollonius.arenas.free_space import free_space, largest_part
from apollonius.errors import InvalidInput
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon

SQUARE = Polygon(((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)))
DISCS = Disc(7.0, 7.0, 1.0), Disc(7.0, 4.7, 1.0), Disc(10.0, 2.0, 1.0)
"""Two with 0.3 m between them, one that stands against a wall."""


def game(radius):
    return Game(
        arena=Arena(discs=DISCS, polygons=(SQUARE,)), pursuer=Unicycle(radius=radius), evader=Unicycle(radius=0.05)
    )


def test_islands_are_obstacles_with_free_space_around_them_for_the_larger_robot():
    narrow, wide = free_space(game(0.2)), free_space(game(0.0))
    assert sorted(island.obstacles for island in narrow.islands) == [
        ("arena.discs[0]", "arena.discs[1]"),
        ("arena.polygons[0]",),
    ]
    assert sorted(island.obstacles for island in wide.islands) == [
        ("arena.discs[0]",),
        ("arena.discs[1]",),
        ("arena.polygons[0]",),
    ]
    square = next(island for island in wide.islands if "arena.polygons[0]" in island.obstacles)
    assert (square.x, square.y) == pytest.approx((1.5, 1.5), abs=0.03)
    assert wide.area > narrow.area


def test_only_the_largest_part_is_kept():
    free = np.ones((20, 30), bool)
    free[:, 10] = False
    free[5, 20] = False
    space = largest_part(free, 1.0, 2.0, 0.5)
    assert space.parts == 2
    assert not space.free[:, :11].any()
    assert space.area == (20 * 19 - 1) * 0.25
    assert [(island.x, island.y) for island in space.islands] == [(1.0 + 20.5 * 0.5, 2.0 + 5.5 * 0.5)]


def test_places_that_touch_at_a_corner_are_apart_and_obstacles_that_do_are_not():
    free = np.zeros((8, 8), bool)
    free[:4, :4] = free[4:, 4:] = True
    assert largest_part(free, 0.0, 0.0, 1.0).parts == 2
    free = np.ones((8, 8), bool)
    free[2, 2] = free[3, 3] = False
    assert len(largest_part(free, 0.0, 0.0, 1.0).islands) == 1


def test_a_robot_that_fits_nowhere_is_refused(monkeypatch):
    monkeypatch.setattr(module, "clearances_at", lambda arena, x, y: np.full((8, *x.shape), -1.0))
    with pytest.raises(InvalidInput, match=r"radius = 0\.2 m"):
        free_space(game(0.2))
