"""Where games begin, which of several events counts, who has won (Table 1 of the paper), what it pays, in any arena."""

import itertools
import math
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import to_dict
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.judge import RobotEvents
from apollonius.game.outcome import (
    EVADER_FAILS,
    PURSUER_FAILS,
    come_within,
    counts_by_name,
    decide,
    evader_wins,
    pursuer_wins,
)
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_arenas, make_game, paper
from apollonius.game.reward import Reward
from apollonius.game.starts import Starts
from apollonius.game.teams import Teams
from apollonius.game.types import BySide, GameState, Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.solve.motion import motion_of
from tests.acting import clearances, robot
from tests.oracle.numpy_game import judge

EVENTS = ("captured", "pursuer_hit", "pursuer_out", "evader_hit", "evader_out", "territory_reached", "out_of_time")


def test_decide_matches_the_oracle_for_all_combinations_of_events():
    combinations = list(itertools.product((False, True), repeat=len(EVENTS)))
    decided = jax.vmap(lambda row: decide(**dict(zip(EVENTS, row, strict=True))))(jnp.asarray(combinations))
    for row, outcome in zip(combinations, decided, strict=True):
        flags = dict(zip(EVENTS, row, strict=True))
        fates = [
            "HIT_OBSTACLE" if flags[f"{side}_hit"] else "OUT_OF_RANGE" if flags[f"{side}_out"] else None
            for side in ("pursuer", "evader")
        ]
        expected = judge(flags["captured"], *fates, flags["territory_reached"], flags["out_of_time"])
        assert Outcome(int(outcome)).name == expected, flags


def test_sides_win_by_opponent_failure_and_the_evader_by_the_time_limit():
    evaders = {Outcome.PURSUER_HIT_OBSTACLE, Outcome.PURSUER_OUT_OF_RANGE, Outcome.TERRITORY_REACHED}
    for wins, outcomes in (
        (pursuer_wins, {Outcome.CAPTURED, Outcome.EVADER_HIT_OBSTACLE, Outcome.EVADER_OUT_OF_RANGE}),
        (partial(evader_wins, time_limit_wins=False), evaders),
        (partial(evader_wins, time_limit_wins=True), evaders | {Outcome.NO_RESULT}),
    ):
        assert {outcome for outcome in Outcome if wins(jnp.asarray(outcome))} == outcomes


def test_outcome_counts_omit_a_territory_that_was_never_reached():
    counts = jnp.arange(len(Outcome)).at[Outcome.TERRITORY_REACHED].set(0)
    names = {outcome.name.lower() for outcome in Outcome} - {"ongoing"}
    assert set(counts_by_name(counts)) == names - {"territory_reached"}
    assert counts_by_name(jnp.arange(len(Outcome)))["territory_reached"] == 8


def test_capture_needs_less_than_the_capture_distance():
    pursuer, evader = (robot(0, 0),) * 2, (robot(0.25, 0),) * 2
    assert not come_within(pursuer, evader, 0.25)
    assert come_within(pursuer, evader, 0.2500001)


def test_paper_preset_matches_table_1_and_robot_preset_adds_bodies():
    point, body = Unicycle(0.0, 1.2, 0.3, 0.8, 0.0), Unicycle(0.0, 1.2, 0.3, 0.8, 0.2)
    game = Game(
        point, point, Arena(0.0, 10.0, 0.0, 10.0, paper().arena.discs), capture_distance=0.3, dt=0.1, max_steps=1000,
        reward=Reward("paper", capture=10.0, failure=10.0, progress=3.0),
    )  # fmt: skip
    assert paper() == make_game("paper") == game
    robots = make_game("robot")
    assert robots == replace(game, pursuer=body, evader=body, capture_distance=robots.capture_distance)
    assert robots.capture_distance > 2 * body.radius


ARENA = Arena(discs=(Disc(5.0, 5.0, 1.0),))
PURSUER, EVADER = Unicycle(v_min=0.2, v_max=1.0, radius=0.1), Unicycle(v_min=-0.5, v_max=2.0, radius=0.4)
DRAWS = 10_000


@jax.jit
def sample(starts, key):
    bodies = BySide((PURSUER,), (EVADER,))
    return jax.vmap(starts.sample, in_axes=(0, None, None))(jax.random.split(key, DRAWS), ARENA, bodies)


def is_uniform(values, low, high, bins=50):
    counts, _ = np.histogram(values, bins, (low, high))
    return counts.sum() == len(values) and stats.chisquare(counts).pvalue > 1e-3


@pytest.mark.parametrize("short", [0, 1, 2])
def test_start_distances_are_inclusive_bounds(short):
    """Along the lower wall, in quarters of a metre, so that nothing is rounded: of either robot and between them."""
    starts, body = Starts(clearance=0.5, separation=2.0), Unicycle(radius=0.25)

    def fit(*places):
        pursuer, evader = ((role, body, robot(*places[2 * role : 2 * role + 2])) for role in Role)
        return bool(starts.fits(ARENA, pursuer, []) & starts.fits(ARENA, evader, [pursuer]))

    places = [1.0, 0.75, 3.0, 0.75]
    assert fit(*places)
    places[short] += [0.25, -0.25, -0.25][short]
    assert not fit(*places)
    assert not fit(1.0, 0.75, 3.0, 0.75 - 2**-20)


def test_start_pairs_are_uniform_over_all_pairs_that_fit():
    """As what a simple rejection in NumPy leaves."""
    apart = sample(Starts(clearance=0.3, separation=5.0), jax.random.key(1))
    places = np.random.default_rng(0).uniform(0, 10, (200_000, 2, 2))
    to_wall = np.minimum(places, 10 - places).min(axis=-1)
    room = np.minimum(to_wall, np.linalg.norm(places - 5, axis=-1) - 1)
    fits = (room >= [0.4, 0.7]).all(axis=-1) & (np.linalg.norm(places[:, 0] - places[:, 1], axis=-1) >= 5)
    expected = places[fits]
    ours = np.array([[one.x, one.y] for one in (apart.pursuer, apart.evader)]).transpose(2, 0, 1)
    for measure in (
        lambda pairs: pairs[:, 0, 0],
        lambda pairs: pairs[:, 1, 1],
        lambda pairs: np.linalg.norm(pairs - 5, axis=-1)[:, 0],
        lambda pairs: np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=-1),
    ):
        assert stats.ks_2samp(measure(ours), measure(expected)).pvalue > 1e-3


@pytest.mark.parametrize("speed", ["rest", "moving"])
def test_start_headings_and_moving_speeds_are_uniform(speed):
    states = sample(Starts(speed=speed), jax.random.key(2))
    for drawn, low, high, slowest in ((states.pursuer, 0.2, 1.0, 0.2), (states.evader, -0.5, 2.0, 0.0)):
        assert is_uniform(drawn.heading, -np.pi, np.pi)
        assert is_uniform(drawn.v, low, high) if speed == "moving" else np.all(drawn.v == np.float32(slowest))


LINE, PATHS = Reward(), Reward(along_paths=True)


def walled_game(top):
    """A game in an arena with a wall up to there."""
    wall = Polygon(((4.0, 0.0), (4.2, 0.0), (4.2, top), (4.0, top)))
    return with_chart(Game(arena=Arena(0.0, 8.0, 0.0, 8.0, polygons=(wall,)), reward=PATHS))


step = jax.jit(Game.step)


def pay(game, pursuers, evader):
    """Both sides' rewards for a step in which nobody steers."""
    state = GameState.at_start(BySide(tuple(pursuers), (evader,)))
    stay = jnp.asarray(4)
    rewards = step(game, state, [stay] * len(pursuers), [stay]).rewards
    return float(rewards.pursuer[0]), float(rewards.evader[0])


def test_path_reward_pays_for_driving_round_a_wall():
    """Up along the wall at 1.2 m/s: 0.12 m of the way, while the evader behind it comes no nearer."""
    pursuer, evader = robot(3.0, 3.0, 1.2, math.pi / 2), robot(5.0, 3.0)
    wall = walled_game(6.0)
    assert pay(wall, [pursuer], evader) == pytest.approx((0.36, -0.36), abs=0.04)
    assert abs(pay(replace(wall, reward=LINE), [pursuer], evader)[0]) < 0.02
    back = replace(pursuer, heading=jnp.float32(-math.pi / 2))
    assert pay(wall, [back], evader) == pytest.approx((-0.36, 0.36), abs=0.04)
    fleeing = robot(5.0, 3.0, 1.2, -math.pi / 2)
    assert pay(wall, [robot(3.0, 3.0)], fleeing) == pytest.approx((-0.36, 0.36), abs=0.04)


@pytest.mark.parametrize(
    ("top", "pursuer", "evader"),
    [(6.0, (1.0, 3.0, 1.2, 0.7), (3.0, 2.0, 0.9, 2.0)), (8.0, (3.0, 3.0, 1.2, 0.3), (5.0, 2.0, 0.9, 2.0))],
    ids=["in sight", "without a way"],
)
def test_path_reward_is_the_straight_line_in_sight_or_without_a_path(top, pursuer, evader):
    game, robots = walled_game(top), ([robot(*pursuer)], robot(*evader))
    assert pay(game, *robots) == pay(replace(game, reward=LINE), *robots)


def test_path_reward_of_a_team_follows_the_shortest_path():
    """One waits just behind the wall; the other is farther off, but on the evader's side, and drives there."""
    game = replace(walled_game(6.0), teams=Teams((Unicycle(),)))
    pursuers, evader = [robot(3.5, 3.0), robot(7.5, 3.0, 1.2, math.pi)], robot(5.0, 3.0)
    assert pay(game, pursuers, evader) == pytest.approx((0.36, -0.36), abs=1e-5)
    assert pay(replace(game, reward=LINE), pursuers, evader) == pytest.approx((0.0, 0.0), abs=1e-5)


def test_path_reward_without_a_chart_is_refused_in_one_line():
    game = walled_game(6.0)
    game = replace(game, chart=None)
    with pytest.raises(InvalidInput, match=r"reward\.along_paths") as refusal:
        pay(game, [robot(3.0, 3.0)], robot(5.0, 3.0))
    assert "\n" not in str(refusal.value)
    assert with_chart(game, False) == walled_game(6.0), "the reward reads them"
    assert with_chart(replace(game, reward=LINE), False).chart is None


def paid(reward, outcome, before=2.0, after=1.9):
    """In a game of two, whose outcome says what came of both."""
    pursuer_fails, evader_fails = (
        outcome in (*failures, Outcome.BOTH_FAILED) for failures in (PURSUER_FAILS, EVADER_FAILS)
    )
    robots = BySide(
        (RobotEvents(True, False, jnp.asarray(pursuer_fails)),),
        (RobotEvents(True, outcome == Outcome.CAPTURED, jnp.asarray(evader_fails)),),
    )
    (pursuer,), (evader,) = reward(jnp.asarray(outcome), robots, [(jnp.float32(before), jnp.float32(after))])
    return float(pursuer), float(evader)


AGILE = Unicycle(v_max=2.0, u1_max=4.0, u2_max=3.0)
NARROW = Arena(0.0, 4.0, 0.0, 4.0, discs=(Disc(2.0, 2.0, 0.4),))
TRIANGLE = Polygon(((2, 0.5), (4, 0.5), (3, 2)))
WIDE = Arena(-1.0, 5.0, 0.0, 4.0, discs=(Disc(1.0, 1.0, 0.3), Disc(3.0, 3.0, 0.3)), polygons=(TRIANGLE,))
GAME = Game(AGILE, AGILE, NARROW, max_steps=60)
BOTH = in_arenas(GAME, [NARROW, WIDE])


@jax.jit
def outcomes_ahead(game, states):
    """Outcomes of 30 steps straight ahead; in one arena, wherever they are, alone."""
    ahead = jnp.int32(7)

    def step(state, _):
        after = game.step(state, ahead, ahead)
        return after.state, after.outcome

    place = states.variant if game.scenario else None
    return jax.vmap(lambda state, place: jax.lax.scan(step, replace(state, variant=place), length=30)[1])(states, place)


def test_games_in_two_arenas_match_games_in_each_alone():
    starts = jax.jit(reset_batch, static_argnames="games")(BOTH, jax.random.key(0), 400)
    place = np.asarray(starts.variant)
    assert 0.4 < place.mean() < 0.6
    assert np.asarray(starts.pursuer.x)[place == 1].min() < -0.3  # only one arena reaches so far
    together = np.asarray(outcomes_ahead(BOTH, starts))
    for number, arena in enumerate((NARROW, WIDE)):
        here = place == number
        assert clearances(arena, starts.pursuer.x, starts.pursuer.y)[here].min() >= GAME.starts.clearance - 1e-5
        game = replace(GAME, arena=BOTH.scenario.arena(jnp.int32(number)))
        alone = np.asarray(outcomes_ahead(game, starts))
        np.testing.assert_array_equal(together[here], alone[here])
        assert len(set(alone[here].ravel())) > 4


def test_in_arenas_of_one_arena_is_an_ordinary_game():
    assert in_arenas(GAME, [WIDE]) == replace(GAME, arena=WIDE)
    assert len(jax.tree.leaves(GAME.reset(jax.random.key(0)))) == 11


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda: motion_of(BOTH, Role.PURSUER, 1), r"^arenas = 2 is not possible: it must be one, which a table"),
        (lambda: to_dict(BOTH), "as no file holds it"),
        (lambda: in_arenas(GAME, []), "arenas = none"),
        (
            lambda: in_arenas(GAME, [NARROW, replace(WIDE, territory=Disc(0.0, 3.0, 0.3))]),
            "alike but for discs, polygons and maps",
        ),
        (lambda: in_arenas(GAME, [NARROW, replace(NARROW, discs=(Disc(9.0, 2.0, 0.4),))]), r"arena.discs\[0\] centre"),
    ],
)
def test_incompatible_or_several_arenas_are_refused(act, said):
    with pytest.raises(InvalidInput, match=said):
        act()
