"""Where games begin, which of several events in one step counts, who has won, and Table 1 of the paper."""

import itertools
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from apollonius.game.arena import Arena, Disc
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.outcome import counts_by_name, decide, evader_wins, is_captured, pursuer_wins
from apollonius.game.presets import make_game, paper
from apollonius.game.starts import Starts
from apollonius.game.types import GameState, Outcome, RobotState
from tests.oracle.numpy_game import judge

EVENTS = ("captured", "pursuer_hit", "pursuer_out", "evader_hit", "evader_out", "territory_reached", "out_of_time")
COMBINATIONS = [dict(zip(EVENTS, flags, strict=True)) for flags in itertools.product((False, True), repeat=len(EVENTS))]


def test_of_every_combination_of_events_that_counts_which_counts_for_the_oracle():
    columns = {event: jnp.asarray([flags[event] for flags in COMBINATIONS]) for event in EVENTS}
    decided = jax.vmap(lambda flags: decide(**flags))(columns)
    for flags, outcome in zip(COMBINATIONS, decided, strict=True):
        fates = [
            "HIT_OBSTACLE" if flags[f"{side}_hit"] else "OUT_OF_RANGE" if flags[f"{side}_out"] else None
            for side in ("pursuer", "evader")
        ]
        expected = judge(flags["captured"], *fates, flags["territory_reached"], flags["out_of_time"])
        assert Outcome(int(outcome)).name == expected, flags


def test_a_side_wins_by_the_other_ones_failure_and_the_evader_by_time_where_the_rules_say_so():
    evaders = {Outcome.PURSUER_HIT_OBSTACLE, Outcome.PURSUER_OUT_OF_RANGE, Outcome.TERRITORY_REACHED}
    for wins, outcomes in (
        (pursuer_wins, {Outcome.CAPTURED, Outcome.EVADER_HIT_OBSTACLE, Outcome.EVADER_OUT_OF_RANGE}),
        (partial(evader_wins, time_limit_wins=False), evaders),
        (partial(evader_wins, time_limit_wins=True), evaders | {Outcome.NO_RESULT}),
    ):
        assert {outcome for outcome in Outcome if wins(jnp.asarray(outcome))} == outcomes


def test_a_territory_that_was_never_reached_is_no_outcome_to_report():
    counts = jnp.arange(len(Outcome)).at[Outcome.TERRITORY_REACHED].set(0)
    names = {outcome.name.lower() for outcome in Outcome} - {"ongoing"}
    assert set(counts_by_name(counts)) == names - {"territory_reached"}
    assert counts_by_name(jnp.arange(len(Outcome)))["territory_reached"] == 8


def positions(pursuer, evader):
    robots = [RobotState(*jnp.asarray([*place, 0, 0], jnp.float32)) for place in (pursuer, evader)]
    return GameState.of_two(*robots, jnp.asarray(0))


def test_capture_needs_less_than_the_capture_distance():
    meeting = positions((0, 0), (0.25, 0))
    assert not is_captured(meeting, meeting, 0.25)
    assert is_captured(meeting, meeting, 0.2500001)


def test_paper_is_table_1():
    game = paper()
    for robot in (game.pursuer, game.evader):
        assert (robot.v_min, robot.v_max, robot.u1_max, robot.u2_max, robot.radius) == (0, 1.2, 0.3, 0.8, 0)
    assert (game.arena.x_min, game.arena.x_max, game.arena.y_min, game.arena.y_max) == (0, 10, 0, 10)
    assert (game.capture_distance, game.dt, game.max_steps) == (0.3, 0.1, 1000)
    assert (game.reward.capture, game.reward.failure, game.reward.progress, game.reward.profile) == (10, 10, 3, "paper")


def test_the_robots_of_the_robot_game_have_bodies_that_do_not_meet_before_the_capture():
    game = make_game("robot")
    assert game.pursuer == game.evader == Unicycle(radius=0.2)
    assert game.capture_distance > game.pursuer.radius + game.evader.radius
    assert replace(game, pursuer=Unicycle(), evader=Unicycle(), capture_distance=0.3) == make_game("paper")


ARENA = Arena(discs=(Disc(5.0, 5.0, 1.0),))
PURSUER, EVADER = Unicycle(v_min=0.2, v_max=1.0, radius=0.1), Unicycle(v_min=-0.5, v_max=2.0, radius=0.4)
DRAWS = 10_000


@jax.jit
def sample(starts, key):
    bodies = BySide((PURSUER,), (EVADER,))
    return jax.vmap(starts.sample, in_axes=(0, None, None))(jax.random.split(key, DRAWS), ARENA, bodies)


@pytest.fixture(scope="module")
def near():
    """Robots that may start at the same place: their positions are independent."""
    return sample(Starts(clearance=0.3, separation=0.0), jax.random.key(0))


@pytest.fixture(scope="module")
def apart():
    return sample(Starts(clearance=0.3, separation=5.0), jax.random.key(1))


@pytest.fixture(scope="module")
def moving():
    return sample(Starts(speed="moving"), jax.random.key(2))


def is_uniform(values, low, high, bins=50):
    counts, _ = np.histogram(values, bins, (low, high))
    return counts.sum() == len(values) and stats.chisquare(counts).pvalue > 1e-3


@pytest.mark.parametrize("short", [0, 1, 2])
def test_what_is_asked_for_is_enough_and_less_is_not(short):
    """Along the lower wall, in quarters of a metre, so that nothing is rounded: of either robot and between them."""
    starts, body = Starts(clearance=0.5, separation=2.0), Unicycle(radius=0.25)
    places = [1.0, 0.75, 3.0, 0.75]
    assert bool(starts.fits(ARENA, body, body, *map(jnp.float32, places)))
    places[short] += [0.25, -0.25, -0.25][short]
    assert not bool(starts.fits(ARENA, body, body, *map(jnp.float32, places)))
    places[:] = [1.0, 0.75, 3.0, 0.75 - 2**-20]
    assert not bool(starts.fits(ARENA, body, body, *map(jnp.float32, places)))


def test_pairs_are_uniform_over_all_pairs_that_fit(apart):
    """The distribution of pairs that a simple rejection in NumPy leaves: compared by place and by distance."""
    places = np.random.default_rng(0).uniform(0, 10, (200_000, 2, 2))
    to_wall = np.minimum(places, 10 - places).min(axis=-1)
    room = np.minimum(to_wall, np.linalg.norm(places - 5, axis=-1) - 1)
    fits = (room >= [0.4, 0.7]).all(axis=-1) & (np.linalg.norm(places[:, 0] - places[:, 1], axis=-1) >= 5)
    expected = places[fits]
    ours = np.moveaxis(
        np.array([[apart.pursuer.x, apart.pursuer.y], [apart.evader.x, apart.evader.y]]), -1, 0
    )  # [draws, robot, axis], as `expected`
    for measure in (
        lambda pairs: pairs[:, 0, 0],
        lambda pairs: pairs[:, 1, 1],
        lambda pairs: np.linalg.norm(pairs - 5, axis=-1)[:, 0],
        lambda pairs: np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=-1),
    ):
        assert stats.ks_2samp(measure(ours), measure(expected)).pvalue > 1e-3


@pytest.mark.parametrize("role", ["pursuer", "evader"])
def test_headings_are_uniform_over_the_circle(near, role):
    assert is_uniform(getattr(near, role).heading, -np.pi, np.pi)


def test_at_rest_a_robot_has_speed_zero_or_the_slowest_it_can_go(near):
    assert np.all(near.pursuer.v == np.float32(0.2))
    assert np.all(near.evader.v == 0)


def test_moving_speeds_are_uniform_between_each_robots_own_limits(moving):
    assert is_uniform(moving.pursuer.v, 0.2, 1.0)
    assert is_uniform(moving.evader.v, -0.5, 2.0)
