"""Passages that charts are too coarse for are found, and only those; a person hears of them and of other misuse."""

import argparse
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import tomli_w

from apollonius.arenas.charting import charted
from apollonius.arenas.passages import missed_passage
from apollonius.arenas.record import to_dict
from apollonius.catalogue import find_player
from apollonius.cli.main import main
from apollonius.cli.options import warn
from apollonius.game.arena import Arena
from apollonius.game.chart import COARSE, NO_PATH
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.types import Role

AT = 9.8
"""Where the wall begins that parts the floor [m]."""


def floor(width, radius=0.2, second=0.0):
    """A floor of 20 by 14 m, parted by a wall with a door of this width, and maybe a second one at its end."""
    body = Unicycle(radius=radius)
    ends = ((0.0, 7.0 - width / 2), (7.0 + width / 2, 14.0 - second))
    wall = tuple(Polygon(((AT, low), (AT + 0.15, low), (AT + 0.15, high), (AT, high))) for low, high in ends)
    return Game(pursuer=body, evader=body, capture_distance=0.6, arena=Arena(x_max=20.0, y_max=14.0, polygons=wall))


def warned(game, players=(), name="floor.toml"):
    """The lines that a command says before such games."""
    lines = []
    warn(argparse.Namespace(game=name, display=SimpleNamespace(tell=lines.append)), game, players)
    return lines


def test_a_door_that_the_chart_does_not_have_is_found_with_the_way_round():
    alone, beside = missed_passage(floor(0.55)), missed_passage(floor(0.55, second=1.5))
    for found in (alone, beside):
        assert (found.x, found.y) == pytest.approx((AT, 7.0), abs=0.3)
        assert 0.9 <= found.resolves <= 1.01
    assert alone.detour == np.inf
    assert 8.0 < beside.detour < 13.0
    assert "m longer. This arena's chart resolves" in str(beside)
    west, east = 20 * COARSE + 5, 20 * COARSE + 35
    assert np.asarray(charted(floor(0.55)).arena.chart.lengths)[0, west, east] == NO_PATH


@pytest.mark.parametrize("game", [floor(1.01), floor(0.55, radius=0.0)], ids=["wide", "thin robots"])
def test_what_the_chart_has_is_not_found(game):
    assert missed_passage(game) is None


def test_the_check_of_an_arena_says_what_its_chart_resolves(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("floor.toml").write_text(tomli_w.dumps(to_dict(floor(0.55))))
    assert main(["arena", "check", "floor.toml", "--json"]) == 0
    (note,) = json.loads(capsys.readouterr().out)["notes"]
    assert note.endswith("know no other way. This arena's chart resolves 1.00 m, so widen it to that.")


def test_players_with_charts_are_warned_of_it_and_others_are_not():
    game = floor(0.55)
    assert warned(game, [find_player("still", Role.EVADER, game)]) == []
    (line,) = warned(game, [find_player("P_any", Role.PURSUER, game)])
    assert line.startswith("floor.toml: the passage at (9.")


def test_arenas_that_are_wrong_and_agents_that_have_not_learned_there_are_told_of_in_a_line_each():
    closed = floor(0.55, radius=0.3)
    agents = [find_player(name, Role.PURSUER, closed) for name in ("P_pool", "P_stage1", "pure-pursuit")]
    learned, *wrong = warned(closed, agents)
    assert learned == "P_pool, P_stage1 have learned in another arena; P_any plays in any"
    assert [line.split(" falls into 2 parts")[0] for line in wrong] == [
        "floor.toml: the pursuer's free space",
        "floor.toml: the evader's free space",
    ]
    assert warned(closed, name="office") == []


@pytest.mark.parametrize(
    "words",
    [
        "evaluate still still",
        "show still still",
        "simulate still still",
        "tournament --pursuers still --evaders still",
        "regret still",
        "exploit pursuer still",
        "pursuers paper",
        "slice P_stage1 --opponent 5 5",
        "solve safety",
        "play",
        "export P_pool --to c --out P_pool.c --game paper",
    ],
)
def test_every_command_about_one_arena_warns_before_it_works(words, tmp_path, monkeypatch):
    class Warned(Exception):
        pass

    def stop(*_):
        raise Warned

    monkeypatch.chdir(tmp_path)
    command = words.split()[0]
    where = "options" if command in ("evaluate", "show", "simulate") else command
    monkeypatch.setattr(f"apollonius.cli.{where}.warn", stop)
    with pytest.raises(Warned):
        main(words.split())
