"""What changes in the course of a stage changes in a straight line, and then no more."""

import jax.numpy as jnp
import pytest
from apollonius.learn.algorithm import linear


@pytest.mark.parametrize(
    ("env_steps", "value"), [(0, 1.0), (250, 0.775), (500, 0.55), (1000, 0.1), (1001, 0.1), (10**9, 0.1)]
)
def test_a_schedule_falls_in_a_straight_line_and_stays(env_steps, value):
    assert linear(1.0, 0.1, over=1000.0, env_steps=jnp.asarray(env_steps)) == pytest.approx(value)


def test_a_schedule_may_rise():
    assert linear(0.0, 2.0, over=10.0, env_steps=jnp.asarray(4)) == pytest.approx(0.8)


def test_a_schedule_over_no_steps_has_its_last_value_from_the_first_step_on():
    assert linear(1.0, 0.1, over=0.0, env_steps=jnp.asarray(1)) == pytest.approx(0.1)
