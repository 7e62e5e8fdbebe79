"""The drive, and MuJoCo's robots, which go where their wheels take them, and no further than a wall."""

import sys
from dataclasses import replace
from math import inf
from xml.etree import ElementTree

import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.types import RobotState
from apollonius.io.errors import InvalidInput
from apollonius.simulate.drive import Drive, References
from apollonius.simulate.physics import Physics, mjcf
from tests.car import Car
from tests.test_extending import WALL, WithCapsules

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


def test_the_robot_goes_as_fast_and_turns_as_far_as_its_wheels_say():
    after = drive_on(Physics(PAPER, Drive()), HERE[:1], 0.5, 0.4, 3.0)
    x, y, v, heading = after[0, :4]
    assert v == pytest.approx(0.5, rel=0.02)
    assert heading == pytest.approx(0.5 + 1.2, rel=0.06)  # it took a while to get going
    radius = 0.5 / 0.4
    ideal = (2 + radius * (np.sin(1.7) - np.sin(0.5)), 5 - radius * (np.cos(1.7) - np.cos(0.5)))
    assert np.hypot(x - ideal[0], y - ideal[1]) < 0.1
    assert after[0, 6] == pytest.approx(0.0, abs=0.01)  # the evader's wheels were told to stand


@pytest.mark.parametrize(("radius", "stops"), [(0.2, True), (0.0, False)])
def test_a_wall_holds_a_robot_that_has_a_radius(radius, stops):
    rows = np.array([[9.0, 5.0, 0.0, 0.0, 2.0, 5.0, 0.0, 0.0]])
    physics = Physics(replace(PAPER, pursuer=Unicycle(radius=radius)), Drive())
    x = drive_on(physics, rows, 0.5, 0.0, 4.0)[0, 0]
    assert (x < 10 - radius + 0.02) == stops


HALL = Arena(
    0.0, 6.0, 0.0, 4.0, discs=(Disc(1.0, 1.0, 0.3),), polygons=(Polygon(((3.0, 1.0), (5.0, 1.0), (4.0, 3.0))),)
)


def geoms(game, drive=None):
    root = ElementTree.fromstring(mjcf(game, drive or Drive(), 0.005))
    return {geom.get("name"): geom.attrib for geom in root.iter("geom")}


def numbers(text):
    return [float(number) for number in text.split()]


def test_walls_stand_around_the_arena_and_obstacles_where_they_are():
    found = geoms(Game(arena=HALL))
    obstacles = [geom for name, geom in found.items() if name.startswith("obstacle")]
    assert [geom["type"] for geom in obstacles] == ["box"] * 4 + ["cylinder"] + ["box"] * 3
    assert {numbers(geom["pos"])[2] - numbers(geom["size"])[-1] for geom in obstacles} == {0}, "they stand on the floor"
    bottom, right = obstacles[:2]
    assert numbers(bottom["pos"])[:2] == [3.0, -0.05]
    assert numbers(bottom["size"])[:2] == pytest.approx([3.05, 0.05])
    assert numbers(right["pos"])[:2] == [6.05, 2.0]
    disc = obstacles[4]
    assert numbers(disc["pos"])[:2] == [1.0, 1.0]
    assert numbers(disc["size"])[0] == 0.3
    slope = obstacles[6]  # from (5, 1) to (4, 3)
    assert numbers(slope["pos"])[:2] == [4.5, 2.0]
    assert numbers(slope["size"])[0] == pytest.approx(5**0.5 / 2)
    w, *_, z = numbers(slope["quat"])
    assert 2 * np.arctan2(z, w) == pytest.approx(np.arctan2(2, -1))


def test_robots_weigh_what_the_drive_says_and_have_a_shell_where_the_game_gives_them_a_radius():
    body = Unicycle(radius=0.2)
    found = geoms(replace(make_game("paper"), pursuer=body), Drive(mass=12.0))
    mass = sum(float(geom.get("mass", 0)) for name, geom in found.items() if name.startswith("pursuer"))
    assert mass == pytest.approx(12.0)
    assert numbers(found["pursuer shell"]["size"])[0] == pytest.approx(0.19)
    assert "evader shell" not in found


@pytest.mark.parametrize(
    ("game", "drive", "refusal"),
    [
        (PAPER, Drive(latency=0.2), r"latency = 0\.2"),
        (
            replace(PAPER, arena=WithCapsules(capsules=(WALL,))),
            Drive(),
            r"obstacles = Capsule .* discs, polygons and maps",
        ),
        (
            replace(PAPER, pursuer=Car()),
            Drive(),
            r"class of the pursuer = Car .* Unicycle: a body has two driven wheels",
        ),
    ],
    ids=["latency", "capsule", "car"],
)
def test_what_no_body_can_do_is_refused(game, drive, refusal):
    with pytest.raises(InvalidInput, match=refusal):
        Physics(game, drive)


def test_without_mujoco_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(InvalidInput, match="pip install mujoco"):
        Physics(PAPER, Drive())
