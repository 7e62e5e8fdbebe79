"""MuJoCo's robots go where their wheels take them, and no further than a wall."""

from dataclasses import replace

import numpy as np
import pytest

from apollonius.errors import InvalidInput
from apollonius.game.dynamics import Unicycle
from apollonius.game.presets import make_game
from apollonius.simulate.drive import Drive
from apollonius.simulate.physics import Physics
from tests.simulate.test_drive import IDEAL

pytest.importorskip("mujoco")
PAPER = make_game("paper")
HERE = np.array([[2.0, 5.0, 0.0, 0.5, 8.0, 8.0, 0.6, -2.5], [1.0, 1.0, 0.3, 3.1, 9.0, 9.0, 0.0, 0.0]])


def drive_on(physics, rows, v, turn_rate, seconds):
    """Rows after the pursuer was driven at a speed and turn rate, the evader being told to stand."""
    asked = np.concatenate([physics.drive.wheel_speeds(np.array(v), np.array(turn_rate)), np.zeros(2)])
    steps = round(seconds / physics.step)
    after = physics.advance(physics.place(rows), np.tile(asked, (len(rows), steps, 1)))
    return physics.measure(after)


def test_robots_are_placed_as_they_are_measured():
    physics = Physics(PAPER, Drive())
    assert physics.measure(physics.place(HERE)) == pytest.approx(HERE, abs=1e-12)


def test_a_step_of_the_game_is_divided_evenly():
    physics = Physics(replace(PAPER, dt=0.012), Drive(latency=0.0))
    assert (physics.steps, physics.step) == (3, pytest.approx(0.004))


def test_the_robot_goes_as_fast_and_turns_as_far_as_its_wheels_say():
    after = drive_on(Physics(PAPER, Drive()), HERE[:1], 0.5, 0.4, 3.0)
    x, y, v, heading = after[0, :4]
    assert v == pytest.approx(0.5, rel=0.02)
    assert heading == pytest.approx(0.5 + 1.2, rel=0.06)  # it took a while to get going
    radius = 0.5 / 0.4
    ideal = (2 + radius * (np.sin(1.7) - np.sin(0.5)), 5 - radius * (np.cos(1.7) - np.cos(0.5)))
    assert np.hypot(x - ideal[0], y - ideal[1]) < 0.1
    assert after[0, 6] == pytest.approx(0.0, abs=0.01)  # the evader's wheels were told to stand


def test_without_grip_the_wheels_spin_and_the_robot_stays_behind():
    slippery = drive_on(Physics(PAPER, Drive(friction=0.02, lag=0.0)), HERE[:1], 1.0, 0.0, 1.0)
    assert slippery[0, 2] < 0.3
    assert drive_on(Physics(PAPER, IDEAL), HERE[:1], 1.0, 0.0, 1.0)[0, 2] > 0.95


@pytest.mark.parametrize(("radius", "stops"), [(0.2, True), (0.0, False)])
def test_a_wall_holds_a_robot_that_has_a_radius(radius, stops):
    rows = np.array([[9.0, 5.0, 0.0, 0.0, 2.0, 5.0, 0.0, 0.0]])
    physics = Physics(replace(PAPER, pursuer=Unicycle(radius=radius)), Drive())
    x = drive_on(physics, rows, 0.5, 0.0, 4.0)[0, 0]
    assert (x < 10 - radius + 0.02) == stops


def test_a_latency_of_more_than_a_step_is_refused():
    with pytest.raises(InvalidInput, match=r"latency = 0\.2"):
        Physics(PAPER, Drive(latency=0.2))


def test_without_mujoco_it_says_what_to_install(monkeypatch):
    def missing(name):
        raise ModuleNotFoundError(name=name)

    monkeypatch.setattr("apollonius.simulate.physics.import_module", missing)
    with pytest.raises(InvalidInput, match="pip install mujoco"):
        Physics(PAPER, Drive())
