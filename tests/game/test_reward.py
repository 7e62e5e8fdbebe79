"""Both robots' pay beyond what their twin in NumPy says: farther apart, and along the shortest way round a wall."""

import functools
import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import pytest

from apollonius.arenas.charting import charted
from apollonius.game.arena import Arena
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.judge import fates
from apollonius.game.polygon import Polygon
from apollonius.game.reward import Reward
from apollonius.game.teams import Teams
from apollonius.game.types import GameState, Outcome
from apollonius.io.errors import InvalidInput
from tests.acting import robot

STAY = 4
"""Neither faster nor slower, nor any turn."""
LINE, PATHS = Reward(), Reward(along_paths=True)


def wall_to(top):
    return Arena(0.0, 8.0, 0.0, 8.0, polygons=(Polygon(((4.0, 0.0), (4.2, 0.0), (4.2, top), (4.0, top))),))


@functools.cache
def divided(top):
    """A game in that arena, with its chart."""
    return charted(Game(arena=wall_to(top), reward=PATHS))


step = jax.jit(Game.step)


def pay(game, pursuers, evader):
    """Both sides' rewards for a step in which nobody steers."""
    state = GameState.at_start(BySide(tuple(pursuers), (evader,)))
    actions = [jnp.asarray(STAY)] * len(pursuers)
    rewards = step(game, state, actions, [jnp.asarray(STAY)]).rewards
    return float(rewards.pursuer[0]), float(rewards.evader[0])


def test_driving_round_a_wall_pays_and_the_straight_line_does_not():
    """Up along the wall at 1.2 m/s: 0.12 m of the way, while the evader behind it comes no nearer."""
    pursuer, evader = robot(3.0, 3.0, 1.2, math.pi / 2), robot(5.0, 3.0)
    wall = divided(6.0)
    assert pay(wall, [pursuer], evader) == pytest.approx((0.36, -0.36), abs=0.04)
    assert abs(pay(replace(wall, reward=LINE), [pursuer], evader)[0]) < 0.02
    back = replace(pursuer, heading=jnp.float32(-math.pi / 2))
    assert pay(wall, [back], evader) == pytest.approx((-0.36, 0.36), abs=0.04)
    fleeing = robot(5.0, 3.0, 1.2, -math.pi / 2)
    assert pay(wall, [robot(3.0, 3.0)], fleeing) == pytest.approx((-0.36, 0.36), abs=0.04)


@pytest.mark.parametrize(
    ("top", "pursuer", "evader"),
    [
        (6.0, (1.0, 3.0, 1.2, 0.7), (3.0, 2.0, 0.9, 2.0)),
        (8.0, (3.0, 3.0, 1.2, 0.3), (5.0, 2.0, 0.9, 2.0)),
    ],
    ids=["in sight", "without a way"],
)
def test_in_sight_and_where_there_is_no_way_it_is_the_straight_line(top, pursuer, evader):
    game, robots = divided(top), ([robot(*pursuer)], robot(*evader))
    assert pay(game, *robots) == pay(replace(game, reward=LINE), *robots)


def test_of_a_team_the_one_with_the_shortest_way_is_paid_for():
    """One waits just behind the wall; the other is farther off, but on the evader's side, and drives there."""
    game = replace(divided(6.0), teams=Teams((Unicycle(),)))
    pursuers, evader = [robot(3.5, 3.0), robot(7.5, 3.0, 1.2, math.pi)], robot(5.0, 3.0)
    assert pay(game, pursuers, evader) == pytest.approx((0.36, -0.36), abs=1e-5)
    assert pay(replace(game, reward=LINE), pursuers, evader) == pytest.approx((0.0, 0.0), abs=1e-5)


def test_a_game_without_charts_is_refused_in_one_line():
    game = Game(arena=wall_to(6.0), reward=PATHS)
    with pytest.raises(InvalidInput, match=r"reward\.along_paths") as refusal:
        pay(game, [robot(3.0, 3.0)], robot(5.0, 3.0))
    assert "\n" not in str(refusal.value)
    assert charted(game, False) == divided(6.0), "whoever plays draws them, as the reward reads them"
    assert charted(replace(game, reward=LINE), False).arena.chart is None


def paid(reward, outcome, before=2.0, after=1.9):
    """In a game of two, whose outcome says what came of both."""
    found = jnp.asarray(outcome)
    (pursuer,), (evader,) = reward(found, fates(found, None, None), [(jnp.float32(before), jnp.float32(after))])
    return float(pursuer), float(evader)


@pytest.mark.parametrize(
    ("before", "after", "pursuer", "evader"),
    [(2.0, 2.5, -1.0, 1.0), (4.0, 3.5, 1.0, 1.0), (3.0, 3.5, -1.0, -1.0), (2.5, 3.25, -1.5, 0.5)],
)
def test_beyond_the_zero_sum_part_the_evader_too_is_paid_for_coming_closer(before, after, pursuer, evader):
    """Two per metre, zero-sum within 3 m; the last step goes half a metre up to there and a quarter beyond."""
    reward = Reward(progress=2.0, zero_sum_within=3.0)
    assert paid(reward, Outcome.ONGOING, before, after) == pytest.approx((pursuer, evader))
    assert paid(reward, Outcome.CAPTURED, before, after) == (10, -10)
    assert paid(reward, Outcome.EVADER_HIT_OBSTACLE, before, after) == pytest.approx((pursuer, -10))
