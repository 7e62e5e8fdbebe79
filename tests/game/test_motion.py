"""How a robot moves (Eq. 1), against an ODE solver, what drives do to that, and what it sees, against NumPy."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.integrate import solve_ivp

from apollonius.arenas.file import find_game
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle, action_levels, sinc, unit_vector, wrap_angle
from apollonius.game.fusion_barrier import fusion_barrier
from apollonius.game.game import distance
from apollonius.game.nearby import surroundings
from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.game.polygon import Edges, Polygon
from apollonius.game.presets import in_teams, make_game, randomised
from apollonius.game.scenario import Spread
from apollonius.game.sensing import BOUND, MOST_LAG, Drive, Drives, Noise, Sensors, drive_of, sense
from apollonius.game.types import ROLES, BySide, GameState, RobotState, Role
from apollonius.play.rollout import step_driven
from tests.acting import robot
from tests.oracle.numpy_sight import meets_cells, meets_disc, meets_polygon

PI = np.float32(np.pi)
BODY = Unicycle()

move = jax.jit(Unicycle.move)


@pytest.mark.parametrize(("v", "u1"), [(0.0, 0.3), (0.5, 0.3), (0.5, -0.3), (1.18, 0.3), (0.02, -0.3)])
def test_a_turn_is_off_by_less_than_20_micrometres_in_one_step(v, u1):
    """Also where the speed meets its limit within the step."""

    def rate(time, place):
        speed, heading = min(max(v + u1 * time, 0.0), 1.2), 1.0 + 0.8 * time
        return [speed * math.cos(heading), speed * math.sin(heading)]

    exact = solve_ivp(rate, (0, 0.1), [0, 0], max_step=1e-3, rtol=1e-9).y[:, -1]
    after = move(BODY, RobotState(*jnp.asarray([0, 0, v, 1], jnp.float32)), jnp.float32(u1), jnp.float32(0.8), 0.1)
    assert math.hypot(after.x - exact[0], after.y - exact[1]) < 2.01e-5


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("cut", [-PI, PI])
def test_pi_itself_and_every_neighbour_of_the_cut_wrap_to_the_right_side(cut, compiled):
    angles = (cut.view(np.int32) + np.arange(-200, 201, dtype=np.int32)).view(np.float32)
    wrap = jax.vmap(wrap_angle)
    ours = np.asarray((jax.jit(wrap) if compiled else wrap)(angles))
    assert ours[200] == PI
    assert np.all((ours > -PI) & (ours <= PI))
    np.testing.assert_allclose(np.exp(1j * ours), np.exp(1j * angles), atol=1e-6)


def test_the_distance_of_two_robots_is_that_of_their_centres():
    state = GameState.of_two(robot(2.0, 3.0, 1.0, 0.5), robot(5.0, 7.0, 0.0, -1.0), jnp.int32(0))
    assert float(distance(state)) == 5.0


def test_the_unit_vector_is_cosine_and_sine_to_one_in_a_million():
    angles = np.linspace(-9, 9, 20_001).astype(np.float32)
    exact = np.cos(angles.astype(float)), np.sin(angles.astype(float))
    np.testing.assert_allclose(jax.vmap(unit_vector)(angles), exact, atol=1e-6)


@pytest.mark.parametrize(("reach", "error"), [(0.6, 1.5e-7), (1.0, 3e-6)])
def test_sinc_is_the_sine_over_the_angle(reach, error):
    angles = np.linspace(-reach, reach, 1001, dtype=np.float32)
    np.testing.assert_allclose(jax.vmap(sinc)(angles), np.sinc(angles.astype(float) / np.pi), atol=error)


def test_levels_are_shares_of_the_largest_controls_and_clipped():
    body = Unicycle(u1_max=0.5, u2_max=2.0)
    np.testing.assert_allclose(body.controls(jnp.array([0.5, -0.25])), (0.25, -0.5))
    np.testing.assert_allclose(body.controls(jnp.array([3.0, -1.5])), (0.5, -2.0))
    np.testing.assert_allclose(action_levels(jnp.asarray(5)), (0, 1))


DT = 0.1
LEFT, RIGHT, FASTER_LEFT = 5, 3, 8


def responses(drive, actions):
    """The controls that actions come to, one after the other."""
    made, state = [], drive.begin()
    for action in actions:
        controls, state = drive.respond(state, BODY, jnp.asarray(action), DT)
        made.append([float(control) for control in controls])
    return made


def test_without_limits_actions_come_to_their_own_controls():
    wanted = [[float(control) for control in BODY.controls(jnp.asarray(action))] for action in range(9)]
    for drive in (Drive(), Drive(lag=0, turn_time=0.0)):
        assert responses(drive, range(9)) == [pytest.approx(controls, abs=2e-5) for controls in wanted]


@pytest.mark.parametrize("lag", [1, 2, MOST_LAG])
def test_late_commands_come_when_they_are_due(lag):
    made = responses(Drive(lag=lag), [FASTER_LEFT, RIGHT] + [LEFT] * lag)
    expected = [[0, 0]] * lag + [[0.3, 0.8], [0, -0.8]]
    assert made == [pytest.approx(controls, abs=2e-5) for controls in expected]


def test_a_turn_rate_takes_its_time_and_turns_the_robot_by_its_mean():
    """Against the integral of a ramp to the wanted rate, in small steps."""
    made = responses(Drive(turn_time=0.25), [LEFT] * 4 + [RIGHT] * 3)
    rate, slope, means = 0.0, 0.8 / 0.25, []
    for wanted in [0.8] * 4 + [-0.8] * 3:
        total = 0.0
        for _ in range(1000):
            rate += np.clip(wanted - rate, -slope * DT / 1000, slope * DT / 1000)
            total += rate / 1000
        means.append(total)
    assert [u2 for _, u2 in made] == pytest.approx(means, abs=1e-3)


def test_each_robot_of_a_team_has_the_drive_of_its_side():
    """Late pursuers stand while the evader drives off; both pursuers turn as one alone would."""
    game = replace(in_teams(make_game("paper"), 2, 1), drives=Drives(pursuer=Drive(lag=3)))
    state = game.reset(jax.random.key(0))
    drives = ROLES.map(lambda role: (drive_of(game.drives, role).begin(),) * len(game.bodies[role]))
    speeds = []
    for _ in range(5):
        after, drives = step_driven(game, state, drives, BySide((jnp.asarray(7), jnp.asarray(7)), (jnp.asarray(7),)))
        state = after.state
        speeds.append([float(robot.v) for side in state.robots for robot in side])
    assert speeds == [pytest.approx([max(0, step - 3) * 0.03] * 2 + [step * 0.03], abs=1e-5) for step in range(1, 6)]


def test_numbers_that_each_game_draws_are_spread_as_asked():
    """Whole ones over all values with both ends, others over their range, each apart, in the games' own bodies."""
    spreads = [
        Spread(("drives.pursuer.lag", "drives.evader.lag"), 0.0, 2.0),
        Spread(("sensors.pursuer.noise.heading", "evader.v_max"), 0.5, 1.0),
    ]
    game = randomised(make_game("paper"), spreads)
    drawn = jax.jit(jax.vmap(lambda key: game.at(game.reset(key))))(jax.random.split(jax.random.key(0), 2000))
    assert np.bincount(drawn.drives.pursuer.lag.astype(int)) / 2000 == pytest.approx([1 / 3] * 3, abs=0.12)
    heading, speed = np.asarray(drawn.sensors.pursuer.noise.heading), np.asarray(drawn.evader.v_max)
    for values in (heading, speed):
        assert (values.min(), values.max()) == (pytest.approx(0.5, abs=0.03), pytest.approx(1.0, abs=0.03))
    assert abs(np.corrcoef(heading, speed)[0, 1]) < 0.3
    assert set(np.asarray(drawn.pursuer.v_max)) == {np.float32(1.2)}
    assert drawn.drives.evader.turn_time is None


def clipped_or_zero(x):
    """Calls functions that JAX compiles on their own."""
    return jnp.where(jnp.clip(2 * x, -1, 1) > 0.5, x, 0)


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="the boundary is for XLA on the CPU")
def test_a_boundary_stands_around_a_function_and_nowhere_within():
    x = jnp.linspace(-1.0, 1.0, 64)
    compiled = jax.jit(lambda x: fusion_barrier(clipped_or_zero)(x) + 1).lower(x).compile()
    assert compiled.as_text().count(" call(") == 1
    assert_array_equal(compiled(x), clipped_or_zero(x) + 1)


OPEN = Arena()
WORDS = jnp.asarray(np.random.default_rng(0).integers(2**32, size=4000, dtype=np.uint32))
YES = jnp.ones((), bool)


def percept(sensors, arena, own, other, bits):
    """What pursuers perceive of an evader, each given with whether it is in play."""
    robots, active = zip(*(zip(*side, strict=True) for side in (own, [other])), strict=True)
    status = BySide(*(tuple(jnp.where(one, 0, 1) for one in side) for side in active))
    return sense(sensors, arena, GameState(BySide(*robots), jnp.int32(0), status=status), Role.PURSUER, bits)


def among(name):
    """An arena, how many pairs of places to look between and how far apart, and what is in between by NumPy."""
    if name == "discs":
        arena = find_game("paper").arena
        discs = [(np.array([disc.x, disc.y]), disc.radius) for disc in arena.discs]
        return arena, 20_000, 10, lambda a, b: any(meets_disc(a, b, *one) for one in discs)
    if name == "polygons":
        arena = replace(find_game("office").arena, discs=())
        outlines = [one.outline() for one in arena.polygons]
        return arena, 800, 3, lambda a, b: any(meets_polygon(a, b, one) for one in outlines)
    cells = np.random.default_rng(2).random((24, 30)) < 0.08
    found = OccupancyMap(jnp.asarray(distance_field(cells, 0.25)), -1.0, 2.0, 0.25, "", "")
    occupied = found.occupied()
    return Arena(-1.0, 6.5, 2.0, 8.0, map=found), 800, 4, lambda a, b: meets_cells(a, b, occupied, -1.0, 2.0, 0.25)


@pytest.mark.parametrize("name", ["discs", "polygons", "cells"])
def test_obstacles_hide_what_numpy_says(name):
    """Where they differ, a shift by rounding must change the oracle's answer."""
    arena, count, longest, meets = among(name)
    rng = np.random.default_rng(1)
    low, high = np.array([arena.x_min, arena.y_min]), np.array([arena.x_max, arena.y_max])
    starts = rng.uniform(low, high, (count, 2))
    ends = np.clip(starts + rng.uniform(-longest, longest, (count, 2)), low, high)
    zero = jnp.zeros(())
    look = jax.vmap(lambda *places: arena.hides(*(RobotState(*place, zero, zero) for place in places)))
    found = np.asarray(jax.jit(look)(jnp.asarray(starts, jnp.float32), jnp.asarray(ends, jnp.float32)))
    expected = np.array([meets(a, b) for a, b in zip(starts, ends, strict=True)])
    assert 0.05 < expected.mean() < 0.95
    for a, b in zip(starts[found != expected], ends[found != expected], strict=True):
        side = np.array([a[1] - b[1], b[0] - a[0]]) / max(np.hypot(*(b - a)), 1e-9) * 2e-5
        assert {meets(a + side, b + side), meets(a - side, b - side)} == {True, False}, (a, b)


@pytest.mark.parametrize(
    ("sensors", "other", "seen"),
    [
        (Sensors(), robot(9, 9), True),
        (Sensors(range=2.0), robot(3, 5), True),
        (Sensors(range=1.9), robot(3, 5), False),
        (Sensors(range=0.0), robot(5, 5.1), False),
        (Sensors(field_of_view=1.0), robot(4.5, 5 + 0.26), True),  # ahead is left: the robot looks along -x
        (Sensors(field_of_view=1.0), robot(4.5, 5 + 0.28), False),
        (Sensors(field_of_view=1.0), robot(6, 5), False),
        (Sensors(field_of_view=6.29), robot(6, 5), True),
        (Sensors(line_of_sight=True), robot(5, 8), True),
    ],
)
def test_range_and_field_of_view(sensors, other, seen):
    found = percept(sensors, OPEN, [(robot(5, 5, 0.0, np.pi), YES)], (other, YES), WORDS[0])
    assert bool(found.seen[0]) is seen


def test_a_side_sees_what_any_of_its_active_robots_sees_of_robots_in_play():
    arena, sensors = Arena(discs=(Disc(5.0, 5.0, 1.0),)), Sensors(line_of_sight=True)
    behind, beside, other = robot(3, 5), robot(5, 8), robot(7, 5)
    for own, there, seen in (
        ([(behind, YES)], YES, False),
        ([(behind, YES), (beside, YES)], YES, True),
        ([(behind, YES), (beside, ~YES)], YES, False),
        ([(beside, YES)], ~YES, False),
    ):
        assert bool(percept(sensors, arena, own, (other, there), WORDS[0]).seen[0]) is seen


def test_errors_have_the_size_asked_for_and_a_bound():
    noise, own = Noise(0.05, 0.1, 0.02), Noise(position=0.2)
    sensors = Sensors(noise=noise, own_noise=own)
    here, there = robot(1, 2, 0.5, 3.1), robot(4, 4, 0.3, -3.1)
    found = jax.vmap(lambda bits: percept(sensors, OPEN, [(here, YES)], (there, YES), bits))(WORDS)
    for robots, truth, asked in ((found.opponents, there, noise), (found.own, here, own)):
        turned = np.angle(np.exp(1j * (np.asarray(robots[0].heading) - float(truth.heading))))
        assert np.all(np.abs(np.asarray(robots[0].heading)) <= np.pi + 1e-6)
        for error, size in (
            (np.asarray(robots[0].x) - float(truth.x), asked.position),
            (np.asarray(robots[0].y) - float(truth.y), asked.position),
            (np.asarray(robots[0].v) - float(truth.v), asked.speed),
            (turned, asked.heading),
        ):
            assert np.std(error) == pytest.approx(size, rel=0.05, abs=1e-6)
            assert np.mean(error) == pytest.approx(0, abs=max(0.1 * size, 1e-6))
            assert np.max(np.abs(error)) <= BOUND * size + 1e-5
    both = np.corrcoef(np.asarray(found.own[0].x), np.asarray(found.opponents[0].x))[0, 1]
    assert abs(both) < 0.06


def test_in_a_drop_out_nothing_is_seen():
    found = jax.vmap(lambda bits: percept(Sensors(drop_out=0.3), OPEN, [(robot(1, 1), YES)], (robot(2, 2), YES), bits))(
        WORDS
    )
    assert np.mean(found.looked) == pytest.approx(0.7, abs=0.03)
    np.testing.assert_array_equal(found.looked, found.seen[0])


REACH, SIZE, LEFTMOST, LOWER = 1.5, 16.0, 10.0, 30.0
"""Of the index; the side of its square and its lower left corner [m]. Cells are a quarter of a metre."""
RNG = np.random.default_rng(5)


def shape(at_x, at_y, *corners):
    return Polygon(tuple((LEFTMOST + at_x + x, LOWER + at_y + y) for x, y in corners))


POLYGONS = (
    shape(3.0, 3.0, (0.0, 0.0), (4.5, 0.3), (4.4, 0.5), (0.0, 0.4)),  # long walls, along x and along y
    shape(11.0, 2.0, (0.0, 0.0), (0.3, 0.0), (0.7, 5.0), (0.4, 5.2)),
    shape(4.0, 8.0, (0.0, 0.0), (1.2, 0.2), (0.3, 0.3), (0.2, 1.2)),  # one with a dent, clockwise and the other way
    shape(8.0, 12.0, (0.0, 0.0), (0.0, 2.5), (2.5, 2.5), (2.5, 0.0)),
    shape(14.0, 13.0, (0.0, 0.0), (0.1, 0.0), (0.05, 0.1)),
)


@pytest.fixture(scope="module")
def index():
    return surroundings(POLYGONS, REACH, LEFTMOST, LEFTMOST + SIZE, LOWER, LOWER + SIZE)


@jax.vmap
def at(x, y):
    zero = jnp.zeros_like(x)
    return RobotState(x, y, zero, zero)


@pytest.mark.parametrize("length", [0.0, 0.7])
def test_what_is_near_is_as_far_away_as_among_all_polygons_up_to_the_reach(length, index):
    """From points, and from segments, among them those that are nearest to a polygon at neither of their ends."""
    x, y = (
        RNG.uniform((LEFTMOST + 1, LOWER + 1), (LEFTMOST + SIZE - 1, LOWER + SIZE - 1), (6000, 2)).astype(np.float32).T
    )
    angle = RNG.uniform(-np.pi, np.pi, 6000)
    ends = at(x, y), at(*np.float32((x + length * np.cos(angle), y + length * np.sin(angle))))
    everything = Edges.of(POLYGONS)
    one = lambda before, after: index.near(before.x, before.y).clearance_along(before, after)  # noqa: E731
    near, every = (np.asarray(jax.jit(jax.vmap(function))(*ends)) for function in (one, everything.clearance_along))
    within = every <= REACH - length
    at_ends = np.min([jax.jit(jax.vmap(everything.clearance))(end.x, end.y) for end in ends], axis=0)
    assert length == 0 or (within & (every < at_ends - 0.01 * length)).sum() > 15
    assert (every < 0).sum() > 50
    assert 500 < within.sum() < 5900
    np.testing.assert_allclose(near[within], every[within], atol=3e-5)
    assert (near[~within] > REACH - length).all()


def test_only_some_are_looked_at_and_none_where_none_is_in_reach(index):
    assert index.within.shape == (64, 64, 4)
    x, y = jnp.float32(LEFTMOST + 15.5), jnp.float32(LOWER + 0.5)
    assert float(index.near(x, y).clearance(x, y)) > 1e5
