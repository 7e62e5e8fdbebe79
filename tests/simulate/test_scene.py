"""The model's text: what stands where."""

from dataclasses import replace
from xml.etree import ElementTree

import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.errors import InvalidInput
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.starts import Starts
from apollonius.simulate.drive import Drive
from apollonius.simulate.scene import mjcf

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


def test_a_map_is_refused():
    cells = OccupancyMap(jnp.ones((4, 4)), 0.0, 0.0, 0.1, "none.yaml", "")
    arena = Arena(0.0, 0.3, 0.0, 0.3, map=cells)
    with pytest.raises(InvalidInput, match=r"obstacles = OccupancyMap .* discs and polygons"):
        mjcf(
            replace(
                make_game("paper"), arena=arena, capture_distance=0.01, starts=Starts(clearance=0.0, separation=0.05)
            ),
            Drive(),
            0.005,
        )
