"""Both robots' pay beyond what their twin in NumPy says, and games in several arenas, each as it goes alone."""

import functools
import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.charting import charted
from apollonius.arenas.record import to_dict
from apollonius.evaluate.result import count_by_arena
from apollonius.game.arena import Arena, Disc
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.judge import fates
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_arenas
from apollonius.game.reward import Reward
from apollonius.game.teams import Teams
from apollonius.game.types import GameState, Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.play.playout import Results
from apollonius.solve.motion import motion_of
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


AGILE = Unicycle(v_max=2.0, u1_max=4.0, u2_max=3.0)
NARROW = Arena(0.0, 4.0, 0.0, 4.0, discs=(Disc(2.0, 2.0, 0.4),))
TRIANGLE = Polygon(((2, 0.5), (4, 0.5), (3, 2)))
WIDE = Arena(-1.0, 5.0, 0.0, 4.0, discs=(Disc(1.0, 1.0, 0.3), Disc(3.0, 3.0, 0.3)), polygons=(TRIANGLE,))
GAME = Game(AGILE, AGILE, NARROW, max_steps=60)
BOTH = in_arenas(GAME, [NARROW, WIDE])
sample = jax.jit(reset_batch, static_argnames="games")


@jax.jit
def held(game, states):
    """Outcomes of 30 steps straight ahead."""
    ahead = jnp.int32(7)

    def step(state, _):
        after = game.step(state, ahead, ahead)
        return after.state, after.outcome

    return jax.vmap(lambda state: jax.lax.scan(step, state, length=30)[1])(states)


def test_games_in_two_arenas_go_as_each_goes_alone_from_starts_in_either():
    starts = sample(BOTH, jax.random.key(0), 400)
    place = np.asarray(starts.place)
    assert 0.4 < place.mean() < 0.6
    assert np.asarray(starts.pursuer.x)[place == 1].min() < -0.3  # only one arena reaches so far
    together, anywhere = np.asarray(held(BOTH, starts)), jax.vmap(lambda state: replace(state, place=None))(starts)
    for number, arena in enumerate((NARROW, WIDE)):
        here = place == number
        clearances = jax.vmap(arena.clearance)(starts.pursuer.x, starts.pursuer.y)[here]
        assert clearances.min() >= GAME.starts.clearance - 1e-5
        alone = np.asarray(held(replace(GAME, arena=BOTH.scenario.arena(jnp.int32(number))), anywhere))
        np.testing.assert_array_equal(together[here], alone[here])
        assert len(set(alone[here].ravel())) > 4


def test_one_arena_is_a_game_as_ever():
    assert in_arenas(GAME, [WIDE]) == replace(GAME, arena=WIDE)
    assert len(jax.tree.leaves(GAME.reset(jax.random.key(0)))) == 9


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda: motion_of(BOTH, Role.PURSUER, 1), r"^arenas = 2 is not possible: it must be one, which a table"),
        (lambda: to_dict(BOTH), "as no file holds it"),
        (lambda: in_arenas(GAME, []), "arenas = none"),
        (
            lambda: in_arenas(GAME, [NARROW, replace(WIDE, territory=Disc(0.0, 3.0, 0.3))]),
            "all with a territory or all without",
        ),
        (lambda: in_arenas(GAME, [NARROW, replace(NARROW, discs=(Disc(9.0, 2.0, 0.4),))]), r"arena.discs\[0\] centre"),
    ],
)
def test_arenas_that_do_not_go_together_or_must_be_one_are_refused(act, said):
    with pytest.raises(InvalidInput, match=said):
        act()


def test_arenas_in_which_nothing_was_played_are_not_counted():
    """A third arena has no game of the two; the pursuer wins that of the first."""
    scenario = in_arenas(GAME, [NARROW, WIDE, NARROW]).scenario
    results = Results(jnp.array([Outcome.CAPTURED, Outcome.NO_RESULT]), jnp.array([3, 4]))
    counted = count_by_arena(scenario, results)
    assert (counted.wins, counted.games) == ((1, 0), (1, 1))
