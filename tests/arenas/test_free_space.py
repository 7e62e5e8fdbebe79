"""Where robots can be: the largest part, islands in it, passages that charts are too coarse for, and whole surveys."""

import argparse
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import tomli_w
from matplotlib.figure import Figure

from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import GALLERY, describe_game, find_game, game_names, to_dict
from apollonius.arenas.free_space import _hexagons, free_space, largest_part, tile
from apollonius.arenas.survey import missed_passage, survey
from apollonius.catalogue import find_player
from apollonius.cli.main import main
from apollonius.cli.options import warn
from apollonius.game.arena import Arena, Disc
from apollonius.game.chart import COARSE, NO_PATH
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import PRESETS
from apollonius.game.starts import Starts
from apollonius.game.types import Role
from apollonius.show.arena import KINDS, kinds_of_places, save_plan
from apollonius.solve.cop_number import core


def test_free_space_counts_islands_for_the_larger_robot():
    """A square, and discs, of which two have 0.3 m between them, and one stands against a wall."""
    square = Polygon(((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)))
    discs = Disc(7.0, 7.0, 1.0), Disc(7.0, 4.7, 1.0), Disc(10.0, 2.0, 1.0)
    evader, arena = Unicycle(radius=0.05), Arena(discs=discs, polygons=(square,))
    narrow, wide = (free_space(Game(Unicycle(radius=radius), evader, arena)) for radius in (0.2, 0.0))
    assert (narrow.islands, wide.islands) == (2, 3)
    assert wide.area > narrow.area


def test_largest_part_keeps_only_the_largest_component():
    free = np.ones((20, 30), bool)
    free[:, 10] = False
    free[5, 20] = False
    space = largest_part(free, 1.0, 2.0, 0.5)
    assert space.parts == 2
    assert not space.free[:, :11].any()
    assert space.area == (20 * 19 - 1) * 0.25
    assert space.islands == 1
    free = np.zeros((8, 8), bool)
    free[:4, :4] = free[4:, 4:] = True
    assert largest_part(free, 0.0, 0.0, 1.0).parts == 2, "places that touch at a corner are apart"
    free = np.ones((8, 8), bool)
    free[2, 2] = free[3, 3] = False
    assert largest_part(free, 0.0, 0.0, 1.0).islands == 1, "and obstacles that do are not"


SIDE = 120
SPIRAL = np.zeros((SIDE, SIDE), bool)
"""A corridor of 6 places that winds inwards, with walls of 4."""
for number in range(6):
    low, high = 10 * number, SIDE - 10 * number
    SPIRAL[low : low + 6, max(0, low - 10) : high] = True
    SPIRAL[low:high, high - 6 : high] = True
    SPIRAL[high - 6 : high, low:high] = True
    SPIRAL[low + 10 : high, low : low + 6] = True
ROOM = np.ones((SIDE, SIDE), bool)
BENT = ROOM.copy()
BENT[30:, 40:70] = False
y, x = np.mgrid[:SIDE, :SIDE] - SIDE / 2
ANNULUS = (np.hypot(x, y) < 55) & (np.hypot(x, y) > 25)


def test_each_point_is_in_the_hexagon_with_the_nearest_centre():
    x, y = np.random.default_rng(0).uniform(0, 6, (2, 3000))
    middles = np.array([(column + row % 2 / 2, row * np.sqrt(0.75)) for row in range(9) for column in range(-1, 8)])
    nearest = np.hypot(x[:, None] - middles[:, 0], y[:, None] - middles[:, 1]).argmin(axis=1)
    pairs = {*zip(nearest.tolist(), _hexagons(x, y).tolist(), strict=True)}
    assert len(pairs) == len(set(nearest)) == len({number for _, number in pairs}) > 40


@pytest.mark.parametrize(("spacing", "angle"), [(7.0, 0.3), (25.0, 0.0), (11.0, np.pi / 6)])
@pytest.mark.parametrize("free", [BENT, SPIRAL], ids=["bent room", "spiral"])
def test_core_without_islands_is_one_cell_for_every_tiling(free, spacing, angle):
    tiling = tile(largest_part(free, 0.0, 0.0, 1.0), spacing, angle)
    assert tiling.holes == 0
    assert len(core(tiling.adjacency)) == 1


@pytest.mark.parametrize("angle", [0.0, np.pi / 6])
@pytest.mark.parametrize("spacing", [6.0, 12.0])
def test_core_around_an_island_is_a_cycle(spacing, angle):
    tiling = tile(largest_part(ANNULUS, 0.0, 0.0, 1.0), spacing, angle)
    kept = core(tiling.adjacency)
    assert tiling.holes == 1
    assert len(kept) >= 2 * np.pi * 25 / spacing
    assert (tiling.adjacency[np.ix_(kept, kept)].sum(axis=1) == 2).all()


AT = 9.8
"""Where the wall begins that parts the floor [m]."""


def floor(width, radius=0.26, second=0.0):
    """A floor of 20 by 14 m, parted by a wall with a door of this width, and maybe a second one at its end."""
    body = Unicycle(radius=radius)
    ends = ((0.0, 7.0 - width / 2), (7.0 + width / 2, 14.0 - second))
    wall = tuple(Polygon(((AT, low), (AT + 0.15, low), (AT + 0.15, high), (AT, high))) for low, high in ends)
    return Game(pursuer=body, evader=body, capture_distance=0.7, arena=Arena(x_max=20.0, y_max=14.0, polygons=wall))


def test_missed_passage_reports_an_unresolved_door_and_its_detour():
    (alone,), (beside,) = missed_passage(floor(0.67)), missed_passage(floor(0.67, second=1.5))
    for found in (alone, beside):
        x, y, resolves = map(float, re.search(r"at \((.*), (.*)\) is .* chart resolves (.*) m, so", found).groups())
        assert (x, y) == pytest.approx((AT, 7.0), abs=0.3)
        assert 1.0 <= resolves <= 1.13
    assert "they know no other way. This" in alone
    assert 8.0 < float(re.search(r"they know a way that is (.*) m longer\. This", beside)[1]) < 13.0
    west, east = 20 * COARSE + 5, 20 * COARSE + 35
    assert np.asarray(with_chart(floor(0.67)).chart.lengths)[0, west, east] == NO_PATH


@pytest.mark.parametrize("game", [floor(1.13), floor(0.55, radius=0.0)], ids=["wide", "thin robots"])
def test_missed_passage_reports_nothing_for_resolved_passages(game):
    assert missed_passage(game) == []


def test_arena_check_states_the_resolution_of_the_chart(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("floor.toml").write_text(tomli_w.dumps(to_dict(floor(0.67))), encoding="utf-8")
    assert main(["arena", "check", "floor.toml", "--json"]) == 0
    (note,) = json.loads(capsys.readouterr().out)["notes"]
    assert note.endswith("know no other way. This arena's chart resolves 1.12 m, so widen it to that.")


def warning_lines(game, players=(), name="floor.toml"):
    lines = []
    warn(argparse.Namespace(game=name, display=SimpleNamespace(print_line=lines.append)), game, players)
    return lines


def test_only_players_that_read_charts_are_warned_of_a_missed_passage():
    game = floor(0.67)
    assert warning_lines(game, [find_player("still", Role.EVADER, game)]) == []
    (line,) = warning_lines(game, [find_player("pursuer", Role.PURSUER, game)])
    assert line.startswith("floor.toml: the passage at (9.")


def test_parted_arenas_and_agents_of_another_arena_get_one_warning_each():
    closed = floor(0.55, radius=0.3)
    agents = [find_player(name, Role.PURSUER, closed) for name in ("P_curriculum", "P_stage1", "pure-pursuit")]
    learned, *wrong = warning_lines(closed, agents)
    assert learned == "P_curriculum, P_stage1 have learned in another arena; pursuer plays in any"
    parted = [line.partition(" falls into 2 parts")[0] for line in wrong]
    assert parted == [f"floor.toml: the {side}'s free space" for side in ("pursuer", "evader")]
    assert warning_lines(closed, name="office") == []


WARNING = {
    "options": ["evaluate still still", "show still still", "simulate still still"],
    "judge": ["tournament --pursuers still --evaders still"],
    "exploit": ["regret still", "exploit pursuer still"],
    "solve": ["pursuers paper", "solve safety"],
    "show": ["slice P_stage1 --opponent 5 5", "play"],
    "export": ["export P_curriculum --to c --out P_curriculum.c --game paper"],
}
"""Commands by the file of the command line that warns."""


@pytest.mark.parametrize(("file", "words"), [(file, words) for file in WARNING for words in WARNING[file]])
def test_every_command_on_one_arena_warns_before_it_works(file, words, tmp_path, monkeypatch):
    class Warned(Exception):
        pass

    def stop(*_):
        raise Warned

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(f"apollonius.cli.{file}.warn", stop)
    with pytest.raises(Warned):
        main(words.split())


GATE = tuple(Disc(5.0, y / 2, 0.4) for y in range(21) if y != 10)
"""Discs from wall to wall with a gate of 2 (0.5 - 0.4) = 0.2 m in the middle."""


def test_survey_finds_pockets_and_gates_between_polygons():
    """Two walls with a gate of 0.2 m between them, and a pillar across one of them."""
    lower, upper = (((4.8, low), (5.2, low), (5.2, high), (4.8, high)) for low, high in ((0.0, 4.9), (5.1, 10.0)))
    pillar = ((4.0, 2.0), (6.0, 2.0), (5.0, 4.0))
    arena = Arena(discs=(Disc(6.0, 8.0, 1.0),), polygons=tuple(Polygon(corners) for corners in (lower, upper, pillar)))
    for radius, parts in ((0.05, 1), (0.15, 2)):
        found = survey(Game(pursuer=Unicycle(radius=radius), arena=arena, starts=Starts(clearance=0.2)))
        assert [numbered.max() for numbered in found.parts] == [parts, 1]
    assert found.blocked.mean() == pytest.approx((2 * 0.4 * 4.9 + 2 - 0.4 * 1.8 + np.pi - 0.1) / 100, rel=0.05)


def ring(radius):
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False).tolist()
    return tuple(Disc(5 + 2 * math.cos(angle), 5 + 2 * math.sin(angle), radius) for angle in angles)


def test_survey_finds_an_unreachable_territory():
    for goal, lines in ((Disc(5.0, 5.0, 0.5), 1), (Disc(1.0, 1.0, 0.5), 0)):
        arena, starts = Arena(discs=ring(0.3), territory=goal), Starts(clearance=1.75, separation=1.8)
        wrong = survey(Game(arena=arena, starts=starts)).wrong
        assert sum("cannot come into arena.territory" in line for line in wrong) == lines


def test_survey_finds_a_haven_of_the_evader():
    """A ring with a gate for the evader alone: the pursuer never starts within, nor comes close enough."""
    pursuer, evader = Unicycle(radius=0.5), Unicycle(radius=0.02)
    game = Game(pursuer, evader, Arena(discs=ring(0.2)), capture_distance=0.52, starts=Starts(clearance=1.4))
    found = survey(game)
    assert any("the evader is safe on" in line for line in found.wrong)
    assert found.haven[250, 250]
    assert not found.haven[20, 20]
    may_reach = replace(game, capture_distance=3.0, starts=Starts(clearance=1.4, separation=3.0))
    assert not survey(may_reach).haven.any()


def test_survey_notes_bodies_that_overlap_or_nearly_touch_at_capture():
    body = Unicycle(radius=0.2)
    found = survey(Game(pursuer=body, evader=body))
    assert found.wrong == ()
    assert found.notes[0].startswith("the bodies overlap before they count as caught: capture_distance = 0.3 m, ")
    (note,) = survey(Game(pursuer=body, evader=body, capture_distance=0.46)).notes
    assert note.startswith("0.06 m are left between the bodies at a capture")
    assert survey(Game(pursuer=body, evader=body, capture_distance=0.51)).notes == survey(Game()).notes == ()


def test_plan_shows_the_survey_and_its_title_counts_the_defects(tmp_path, monkeypatch):
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
    save_plan("gate", replace(game, evader=game.pursuer), found, tmp_path / "plan.png")
    for figure, body in zip(drawn, ("the pursuer's", "a robot's"), strict=True):
        labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
        assert any(label.startswith(f"too near for {body} body (") for label in labels)


def test_arena_check_reports_what_is_wrong(tmp_path, capsys):
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


FILES = game_names()[len(PRESETS) :]


def test_gallery_has_an_office_a_warehouse_and_a_maze():
    assert game_names()[: len(PRESETS)] == list(PRESETS)
    assert {"office", "warehouse", "maze"} <= set(FILES) == {path.stem for path in GALLERY.iterdir()}
    assert all(20 < len(describe_game(name)) < 110 for name in game_names())


@pytest.mark.parametrize("name", [*PRESETS, *FILES])
def test_every_named_arena_passes_the_survey(name):
    game = find_game(name)
    found = survey(game)
    assert (found.wrong, found.notes) == ((), ())
    assert [parts.max() for parts in found.parts] == [1, 1]
    assert not found.haven.any()
    if name in FILES:
        assert 0.02 < found.blocked.mean() < 0.5
        assert game.arena.polygons
