"""The unicycle (Eq. 1) against an ODE solver, its limits, and drives: late commands and slow turns."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from scipy.integrate import solve_ivp

from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle, action_levels, sinc, unit_vector, wrap_angle
from apollonius.game.fusion_barrier import fusion_barrier
from apollonius.game.presets import in_teams, make_game, randomised
from apollonius.game.scenario import Spread
from apollonius.game.sensing import MOST_LAG, Drive, Drives, drive_of
from apollonius.game.types import ROLES, RobotState
from apollonius.play.rollout import step_driven

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


speeds = st.floats(0, 1, width=32)
limits = st.tuples(st.floats(-2, 2, width=32), st.floats(-2, 2, width=32)).map(sorted)


@given(limits, speeds, st.floats(-50, 50, width=32), st.floats(-3, 3, width=32), st.sampled_from([0.01, 0.125, 1.0]))
def test_speed_stays_within_its_limits_and_no_robot_outruns_them(limits, share, u1, heading, dt):
    low, high = (np.float32(limit) for limit in limits)
    v = np.clip(low + np.float32(share) * (high - low), low, high)
    before = RobotState(*jnp.asarray([0, 0, v, heading], jnp.float32))
    after = move(Unicycle(float(low), float(high)), before, jnp.float32(u1), jnp.float32(0.8), dt)
    assert low <= after.v <= high
    assert math.hypot(after.x, after.y) <= max(abs(low), abs(high)) * dt * (1 + 1e-5) + 1e-9


@given(st.floats(float(-PI), float(PI), width=32, exclude_min=True), st.floats(float(-PI), float(PI), width=32))
def test_heading_stays_in_the_half_open_circle(heading, turn):
    before = RobotState(*jnp.asarray([0, 0, 1, heading], jnp.float32))
    after = np.float32(move(BODY, before, jnp.float32(0), jnp.float32(turn), 1.0).heading)
    assert -PI < after <= PI
    assert abs(math.remainder(after - heading - turn, 2 * math.pi)) < 1e-6


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("cut", [-PI, PI])
def test_pi_itself_and_every_neighbour_of_the_cut_wrap_to_the_right_side(cut, compiled):
    angles = (cut.view(np.int32) + np.arange(-200, 201, dtype=np.int32)).view(np.float32)
    wrap = jax.vmap(wrap_angle)
    ours = np.asarray((jax.jit(wrap) if compiled else wrap)(angles))
    assert ours[200] == PI
    assert np.all((ours > -PI) & (ours <= PI))
    np.testing.assert_allclose(np.exp(1j * ours), np.exp(1j * angles), atol=1e-6)


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
