"""A survey finds what is wrong with an arena, and nothing in the gallery, whose arenas are found by their names."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from apollonius.arenas.file import GALLERY, about_game, find_game, game_names
from apollonius.arenas.survey import survey
from apollonius.cli.main import main
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import PRESETS
from apollonius.game.starts import Starts
from apollonius.show.arena import KINDS, kinds_of_places, save_plan

WALL = tuple(Disc(5.0, y / 2, 0.4) for y in range(21))
"""Discs across the whole arena, from wall to wall."""
GATE = tuple(disc for disc in WALL if disc.y != 5.0)
"""The same with a gate of 2 (0.5 - 0.4) = 0.2 m in the middle."""


def test_pockets_and_gates_of_polygons_are_found():
    """Two walls with a gate of 0.2 m between them, and a pillar across one of them."""
    lower, upper = (((4.8, low), (5.2, low), (5.2, high), (4.8, high)) for low, high in ((0.0, 4.9), (5.1, 10.0)))
    pillar = ((4.0, 2.0), (6.0, 2.0), (5.0, 4.0))
    arena = Arena(discs=(Disc(6.0, 8.0, 1.0),), polygons=tuple(Polygon(corners) for corners in (lower, upper, pillar)))
    for radius, parts in ((0.05, 1), (0.15, 2)):
        found = survey(Game(pursuer=Unicycle(radius=radius), arena=arena, starts=Starts(clearance=0.2)))
        assert [numbered.max() for numbered in found.parts] == [parts, 1]
    assert found.blocked.mean() == pytest.approx((2 * 0.4 * 4.9 + 2 - 0.4 * 1.8 + np.pi - 0.1) / 100, rel=0.05)


def test_a_territory_that_cannot_be_reached_is_found():
    ring = tuple(Disc(5 + 2 * float(np.cos(a)), 5 + 2 * float(np.sin(a)), 0.3) for a in np.linspace(0, 2 * np.pi, 25))
    for goal, lines in ((Disc(5.0, 5.0, 0.5), 1), (Disc(1.0, 1.0, 0.5), 0)):
        game = Game(arena=Arena(discs=ring, territory=goal), starts=Starts(clearance=1.75, separation=1.8))
        found = survey(game)
        assert sum("cannot come into arena.territory" in line for line in found.wrong) == lines


def test_a_haven_of_the_evader_is_found():
    """A ring with a gate for the evader alone: the pursuer never starts within, nor comes close enough."""
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = tuple(Disc(5 + 2 * float(np.cos(a)), 5 + 2 * float(np.sin(a)), 0.2) for a in angles)
    game = Game(
        pursuer=Unicycle(radius=0.5), evader=Unicycle(radius=0.02), arena=Arena(discs=ring), capture_distance=0.52,
        starts=Starts(clearance=1.4),
    )  # fmt: skip
    found = survey(game)
    assert any("the evader is safe on" in line for line in found.wrong)
    assert found.haven[250, 250]
    assert not found.haven[20, 20]
    may_reach = replace(game, capture_distance=3.0, starts=Starts(clearance=1.4, separation=3.0))
    assert not survey(may_reach).haven.any()


def test_bodies_that_overlap_before_they_are_caught_are_noted():
    body = Unicycle(radius=0.2)
    found = survey(Game(pursuer=body, evader=body))
    assert found.wrong == ()
    assert "capture_distance = 0.3 m is less than both radii together, 0.4 m" in found.notes[0]
    assert survey(Game(pursuer=body, evader=body, capture_distance=0.4)).notes == ()


def test_the_plan_shows_what_was_found_and_says_what_is_wrong(tmp_path, monkeypatch):
    game = Game(pursuer=Unicycle(radius=0.15), arena=Arena(discs=GATE), starts=Starts(clearance=0.2))
    found = survey(game)
    kinds = kinds_of_places(found)
    free, obstacle, near, cut_off, haven = (kinds == kind for kind in range(len(KINDS)))
    np.testing.assert_array_equal(obstacle, found.blocked)
    np.testing.assert_array_equal(haven, found.haven)
    assert near.sum() == (found.parts[0] == 0).sum() - found.blocked.sum()
    assert min(free.sum(), cut_off.sum()) > 80_000
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path: drawn.append(figure))
    save_plan("gate", game, found, tmp_path / "plan.png")
    (axes,) = drawn[0].axes
    assert axes.get_images()[0].get_extent() == [0, 10, 0, 10]
    assert axes.get_title(loc="left").startswith("gate, 10 x 10 m: 1 thing is wrong")


def test_the_command_says_what_is_wrong(tmp_path, capsys):
    (tmp_path / "tight.toml").write_text("[starts]\nclearance = 4.4")
    picture = tmp_path / "drawn" / "tight.png"
    assert main(["arena", "check", str(tmp_path / "tight.toml"), "--out", str(picture)]) == 1
    printed = capsys.readouterr()
    assert printed.out.startswith("wrong: the pursuer can start on 1.44%")
    assert printed.err.startswith(f"wrote {picture} (")
    assert f"next: mend it, then apollonius arena check {tmp_path / 'tight.toml'}" in printed.err
    assert picture.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(SystemExit):
        main(["arena", "check", "paper", "--out", "plan.bmp"])
    assert "ends in one of .png, .json" in capsys.readouterr().err


FILES = [name for name in game_names() if name not in PRESETS]


def test_there_are_an_office_a_warehouse_and_a_maze_beside_the_presets():
    assert game_names()[: len(PRESETS)] == list(PRESETS)
    assert {"office", "warehouse", "maze"} <= set(FILES) == {path.stem for path in GALLERY.iterdir()}
    assert all(20 < len(about_game(name)) < 110 for name in game_names())


@pytest.mark.parametrize("name", [*PRESETS, *FILES])
def test_each_is_sound_and_its_starts_have_room(name):
    game = find_game(name)
    found = survey(game)
    assert found.wrong == ()
    assert found.notes == ()
    assert [parts.max() for parts in found.parts] == [1, 1]
    assert not found.haven.any()
    if name in FILES:
        assert 0.02 < found.blocked.mean() < 0.5
        assert game.arena.polygons
