"""The drive: wheels for speeds, and what its controller makes of a policy's controls in one step of the game."""

from dataclasses import replace
from math import inf

import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.dynamics import Unicycle
from apollonius.game.types import RobotState
from apollonius.io.errors import InvalidInput
from apollonius.simulate.drive import Drive, References

LIMITS = np.array([[0.0, 1.2], [0.0, 1.2]])
IDEAL = Drive(latency=0.0, lag=0.0, turn_acceleration=inf, friction=10.0, resistance=0.0, torque=1000.0)
"""A drive without delay, lag or slip."""


def wheels(v, turn_rate):
    return list(IDEAL.wheel_speeds(np.array(v), np.array(turn_rate)))


def follow(drive, controls, v=(0.5, 0.0), references=None):
    """What is followed after one step of 0.1 s of both sides' controls."""
    references = references or References(np.array([v]))
    asked = references.follow(
        drive, np.array([controls], float), LIMITS, 20, 0.005, np.full(2, drive.turn_acceleration)
    )
    return references, asked


def test_wheels_roll_as_far_as_their_sides_of_the_robot_move():
    drive = Drive(wheel_radius=0.1, track=0.4)
    left, right = drive.wheel_speeds(np.array(0.6), np.array(0.5))
    assert (left, right) == (pytest.approx(5.0), pytest.approx(7.0))


def test_without_all_parts_the_references_end_where_the_rules_do():
    references, asked = follow(IDEAL, [(0.3, 0.8), (-0.3, -0.8)], v=(1.19, 0.02))
    for side, controls in enumerate([(0.3, 0.8), (-0.3, -0.8)]):
        robot = RobotState(*(jnp.float32(value) for value in (0, 0, (1.19, 0.02)[side], 0)))
        after = Unicycle().move(robot, *(jnp.float32(control) for control in controls), 0.1)
        assert references.v[0, side] == pytest.approx(float(after.v), abs=1e-6)
        assert references.turn_rate[0, side] == controls[1]
    assert asked[0, -1] == pytest.approx(wheels(1.2, 0.8) + wheels(0.0, -0.8))


def test_during_the_latency_the_last_controls_are_in_force():
    references, _ = follow(replace(IDEAL, latency=0.05), [(0.3, 0.8), (0, 0)])
    assert references.v[0, 0] == pytest.approx(0.5 + 0.3 * 0.05)
    _, asked = follow(replace(IDEAL, latency=0.05), [(-0.3, -0.8), (0, 0)], references=references)
    assert asked[0, 9, :2] == pytest.approx(wheels(0.53, 0.8))
    assert asked[0, -1, :2] == pytest.approx(wheels(0.515, -0.8))


def test_the_turn_rate_changes_no_faster_than_the_drive_can():
    references, asked = follow(replace(IDEAL, turn_acceleration=2.0), [(0, 0.8), (0, -0.1)])
    assert references.turn_rate[0] == pytest.approx([0.2, -0.1])
    assert np.abs(np.diff(asked[0, :, 1] - asked[0, :, 0])).max() == pytest.approx(2 * 0.005 * 0.33 / 0.0975)


def test_impossible_drives_are_refused():
    impossible = {"torque": -1.0, "latency": -0.1, "lag": inf, "wheel_mass": 4.5, "mass": inf, "mass_behind": 0.2}
    for name, value in impossible.items():
        with pytest.raises(InvalidInput, match=name):
            Drive(**{name: value})
