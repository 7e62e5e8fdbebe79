"""MuJoCo's robots go where their wheels take them, and no further than a wall."""

import sys
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.io.errors import InvalidInput
from apollonius.simulate.drive import Drive
from apollonius.simulate.physics import Physics, mjcf
from tests.car import Car
from tests.test_extending import WALL, WithCapsules

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
    """Attributes of all geoms by name."""
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
