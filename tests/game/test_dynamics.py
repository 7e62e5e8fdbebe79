"""The unicycle (Eq. 1) against an ODE solver, and its limits."""

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
