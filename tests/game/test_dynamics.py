"""The unicycle (Eq. 1) against an ODE solver, and its limits."""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from apollonius.game.dynamics import Unicycle, action_levels, sinc, unit_vector, wrap_angle
from apollonius.game.types import RobotState

PI = np.float32(np.pi)
BODY = Unicycle()
SERIES = 4e-7
"""What the series of cosine and sine may add to a position for each metre travelled [m]."""

move = jax.jit(Unicycle.move)
move_many = jax.jit(jax.vmap(Unicycle.move, in_axes=(None, 0, 0, 0, None)))


def in_float64(test):
    """Run a test where rounding errors do not hide the integrator's own."""

    @functools.wraps(test)
    def run(*args, **kwargs):
        with jax.enable_x64(True):
            return test(*args, **kwargs)

    return run


def robots(x, y, v, heading):
    return jax.vmap(RobotState)(*(jnp.asarray(number) for number in np.broadcast_arrays(x, y, v, heading)))


def numbers(robot):
    return np.stack([robot.x, robot.y, robot.v, robot.heading], axis=-1)


def solved(body, robot, u1, u2, time):
    """(x, y, v, heading) after `time`, by an ODE solver: one piece up to the speed limit, one along it."""
    limit = body.v_max if u1 > 0 else body.v_min
    ramp_time = time if u1 == 0 else min(time, (limit - robot[2]) / u1)
    for acceleration, duration in ((u1, ramp_time), (0.0, time - ramp_time)):

        def rhs(_, state, acceleration=acceleration):
            return [state[2] * math.cos(state[3]), state[2] * math.sin(state[3]), acceleration, u2]

        robot = solve_ivp(rhs, (0, duration), robot, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return robot


def random_robots(rng, count):
    return np.stack([*rng.uniform(0, 10, (2, count)), rng.uniform(0, 1.2, count), rng.uniform(-3, 3, count)], axis=-1)


def worst_position_error(starts, u1, u2, dt, body=BODY):
    """Largest distance [m] between one step of ours and the ODE solver's."""
    ours = numbers(move_many(body, robots(*starts.T), jnp.asarray(u1), jnp.asarray(u2), dt))
    truth = np.array([solved(body, *example, dt) for example in zip(starts, u1, u2, strict=True)])
    error = ours - truth
    np.testing.assert_allclose(error[:, 2], 0, atol=1e-11)
    np.testing.assert_allclose(np.sin(error[:, 3] / 2), 0, atol=1e-11)
    return np.hypot(*error[:, :2].T).max()


@in_float64
@pytest.mark.parametrize("speed_limits", [(0.0, 1.2), (0.3, 0.7), (-0.5, 0.5)])
def test_straight_motion_is_exact_also_across_the_speed_limits(speed_limits):
    body = Unicycle(*speed_limits)
    rng = np.random.default_rng(1)
    starts = random_robots(rng, 60)
    starts[:, 2] = rng.uniform(*speed_limits, 60)
    u1 = rng.choice([-0.3, 0.3], 60)
    saturated = (starts[:, 2] + u1 < body.v_min) | (starts[:, 2] + u1 > body.v_max)
    assert 10 < saturated.sum() < 60
    assert worst_position_error(starts, u1, np.zeros(60), 1.0, body) < 1.2 * SERIES


@in_float64
def test_an_accelerating_turn_is_off_by_less_than_20_micrometres_in_one_step():
    rng = np.random.default_rng(2)
    starts = random_robots(rng, 60)
    u1, u2 = rng.choice([-0.3, 0.3], 60), rng.choice([-0.8, 0.8], 60)
    assert 1e-5 < worst_position_error(starts, u1, u2, 0.1) < 2.01e-5


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


def test_an_action_is_three_times_the_acceleration_level_plus_the_turning_level():
    u1, u2 = jax.vmap(BODY.controls)(jnp.arange(9))
    expected = [(level_u1 * 0.3, level_u2 * 0.8) for level_u1 in (-1, 0, 1) for level_u2 in (-1, 0, 1)]
    np.testing.assert_allclose(np.stack([u1, u2], axis=-1), expected, rtol=1e-6)


def test_levels_are_shares_of_the_largest_controls_and_clipped():
    body = Unicycle(u1_max=0.5, u2_max=2.0)
    np.testing.assert_allclose(body.controls(jnp.array([0.5, -0.25])), (0.25, -0.5))
    np.testing.assert_allclose(body.controls(jnp.array([3.0, -1.5])), (0.5, -2.0))
    np.testing.assert_allclose(action_levels(jnp.asarray(5)), (0, 1))
