"""What is seen in the robot's own frame: the same wherever the arena lies and however it is turned."""

import math
from dataclasses import replace

import jax
import numpy as np
import pytest

from apollonius.arenas.charting import charted
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.egocentric import AHEAD, COURSES, EGOCENTRIC, NEAR, RAYS
from apollonius.observe.view import look
from tests.acting import of_views, state

SLOW = Unicycle(v_max=0.6, u1_max=0.6, u2_max=1.6, radius=0.15)
WALL = Polygon(((4.0, 0.0), (4.2, 0.0), (4.2, 6.0), (4.0, 6.0)))
GAME = charted(Game(pursuer=SLOW, arena=Arena(0.0, 8.0, 0.0, 8.0, polygons=(WALL,)), capture_distance=0.6))


def looked(states, role, game=GAME):
    """What is seen in several games."""
    return np.asarray(jax.jit(lambda game, states: of_views(EGOCENTRIC, game, states, role))(game, states))


def seen(now, role=Role.PURSUER, game=GAME):
    return looked(jax.tree.map(lambda leaf: leaf[None], now), role, game)[0]


def test_robots_number_by_number():
    """The pursuer at (2, 4) looks up at 0.6 m/s; the evader is 3 m to its right and drives away from it."""
    numbers = seen(state((2.0, 4.0, 0.6, math.pi / 2), (5.0, 4.0, 1.2, 0.0)))[:23]
    own = [0.5, 0.5, 2.0, 2.0, 0.5, 0.0, 1.0, 1.0]
    apart = [0.0, -1.0, 1 / 4, math.log(4) / 2, (3.0 - 0.6) / 3]
    other = [0.0, -1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.8, 0.6, 2.0]
    np.testing.assert_allclose(numbers, own + apart + other, atol=0.03)


def test_rays_number_by_number():
    numbers = seen(state((2.0, 4.0, 0.0, 0.0), (5.0, 4.0, 0.0, 0.0)))[23 : 23 + RAYS]
    assert numbers.shape == (RAYS,)
    for angle, wall in ((0, 2.0), (RAYS // 4, 4.0), (RAYS // 2, 2.0), (3 * RAYS // 4, 4.0)):
        assert numbers[angle] == pytest.approx(1 / (1 + wall - 0.15), abs=0.01)


def test_ways_say_where_to_go_and_who_is_first():
    """Behind a wall 6 m long the evader is not seen, its way leads up, and it is last wherever the pursuer can go."""
    hidden = seen(state((3.0, 4.0, 0.0, math.pi / 2), (5.0, 4.0, 0.0, 0.0)))[23 + RAYS :]
    length = math.hypot(1.15, 2.15) + 0.5 + math.hypot(0.95, 2.15)  # the larger body, 15 cm, stays off the wall's end
    assert hidden[0] == 0
    np.testing.assert_allclose(hidden[1:3], [1 / (1 + length), math.log1p(length) / 2], rtol=0.05)
    longer, shorter, first = hidden[3 : 3 + COURSES], hidden[3 + COURSES : 5 + COURSES], hidden[5 + COURSES :]
    assert longer[0] < -0.8, "a metre and a half up the way is shorter by as much"
    assert longer[COURSES // 2] > 0.8
    assert shorter[0] > 0.5
    assert abs(shorter[1]) < 0.5
    along = min(4.0 - 0.1, AHEAD)
    theirs = math.hypot(0.95, 2.15) + 0.5 + math.hypot(1.15, 2.15 - 1.9)
    mine, later = along / 0.6, theirs / 1.2
    assert first[0] == pytest.approx((later - mine) / (later + mine), abs=0.06)
    plain = seen(state((3.0, 7.0, 0.0, 0.0), (5.0, 7.0, 0.0, 0.0)))[23 + RAYS :]
    assert plain[0] == 1
    assert plain[1] == pytest.approx(1 / 3, abs=1e-3)
    assert NEAR < AHEAD


def test_without_a_chart_it_says_what_is_missing():
    bare = replace(GAME, arena=replace(GAME.arena, chart=None))
    with pytest.raises(InvalidInput, match="a player that reads an arena's chart"):
        EGOCENTRIC(look(bare, state((2.0, 4.0, 0.6, 0.0), (5.0, 4.0, 1.2, 0.0)), Role.EVADER))
