"""Random arenas: one seed, one arena; every gap is kept, and every robot that fits reaches every place."""

import json

import numpy as np
import pytest

from apollonius.arenas.file import load_game
from apollonius.arenas.names import KINDS
from apollonius.arenas.random_arena import random_arena, random_map
from apollonius.arenas.record import from_dict, to_dict
from apollonius.arenas.survey import survey
from apollonius.cli.main import main
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.starts import Starts
from apollonius.io.errors import InvalidInput


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (0, 2, 3))])
@pytest.mark.parametrize("kind", KINDS)
def test_a_robot_just_thinner_than_the_gap_reaches_everything(kind, seed):
    width, height = ((10.0, 10.0), (14.0, 8.0), (9.0, 16.0), (6.0, 6.0))[seed]
    body = Unicycle(radius=0.47)
    arena = random_arena(kind, seed, gap=1.0, width=width, height=height)
    game = Game(pursuer=body, evader=body, arena=arena, capture_distance=1.0, starts=Starts(clearance=0.1))
    game.check()
    assert len(arena.obstacles) >= 1
    found = survey(game)
    assert [parts.max() for parts in found.parts] == [1, 1]
    assert found.wrong == ()


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ({"count": -1}, "discs = -1"),
        ({"count": 200}, "discs = 200 find no room: after .* ask for fewer"),
        ({"gap": -1.0}, "gap = -1"),
        ({"width": 3.0}, "width, height = .* at least 3.6 m"),
        ({"seed": -1}, "seed = -1"),
        ({"kind": "swamps"}, "kind = swamps .* one of discs, blocks"),
        ({"kind": "maze", "width": 2.0}, "width, height = .* two corridors"),
        ({"kind": "racks", "height": 2.0}, "width, height = .* an aisle on either side"),
        ({"kind": "blocks", "gap": 4.7}, "width, height = .* a block with a gap"),
        ({"kind": "rooms", "gap": 9.0}, "width, height = .* two rooms"),
        ({"kind": "rooms", "gap": 1e-3, "width": 90.0}, "gap = 0.001 .* at most 200 polygons"),
        ({"kind": "maze", "width": 60.0, "height": 60.0}, "gap = 1.0 .* wider, or the arena smaller"),
        ({"kind": "caves", "width": 3.9}, "width, height = .* at least 4 m each, 4 gaps"),
        ({"kind": "caves", "gap": 0.07}, "gap = 0.07 .* at least 0.08 m, as a cave has 1,000 cells"),
        ({"gap": 0.0}, "gap = 0.0 .* more than 0"),
        ({"kind": "rooms", "width": 1e6}, "width, height = .* at most 100 m"),
    ],
)
def test_the_impossible_is_refused(numbers, said):
    with pytest.raises(InvalidInput, match=said):
        random_arena(**{"kind": "discs", "seed": 0} | numbers)


def test_the_command_writes_a_game_that_is_sound(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write = ["arena", "random", "--discs", "4", "--seed", "2", "--size", "12", "7"]
    write += ["--game", "robot", "--out", "mine.toml"]
    assert main(write) == 0
    game = load_game(tmp_path / "mine.toml")
    assert game.arena == random_arena("discs", 2, width=12.0, height=7.0, count=4)
    assert game.pursuer == make_game("robot").pursuer
    assert main(["arena", "check", "mine.toml"]) == 0
    assert "nothing is wrong" in capsys.readouterr().out
    assert main([*write, "--seed", "3"]) == 2
    assert "--force" in capsys.readouterr().err
    assert load_game(tmp_path / "mine.toml") == game
    assert main([*write, "--force", "--gap", "0.3"]) == 2
    assert "does not fit through" in capsys.readouterr().err
    assert main(["arena", "random", "--kind", "rooms", "--discs", "3", "--out", "rooms.toml"]) == 2
    assert "--discs" in capsys.readouterr().err
    assert main(["arena", "random", "--kind", "rooms", "--seed", "3", "--out", "rooms.json"]) == 0
    assert load_game(tmp_path / "rooms.json").arena == random_arena("rooms", 3)


def test_a_record_says_how_a_cave_was_drawn():
    game = Game(arena=random_arena("caves", 3, gap=0.9, width=9.0, height=7.5))
    record = json.loads(json.dumps(to_dict(game)))
    drawn = {"file": "caves seed=3 gap=0.9 width=9.0 height=7.5", "sha256": game.arena.map.digest}
    assert record["arena"]["map"] == drawn
    again = from_dict(Game, record, "the record")
    np.testing.assert_array_equal(again.arena.map.field, game.arena.map.field)
    assert to_dict(again) == to_dict(game)
    record["arena"]["map"]["sha256"] = "0" * 64
    with pytest.raises(InvalidInput, match="which this version draws otherwise"):
        from_dict(Game, record, "the record")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("caves", "must be as in 'caves seed=0"),
        ("discs seed=0 gap=1.0 width=10.0 height=10.0", "of a kind that draws cells"),
        ("swamps seed=0 gap=1.0 width=10.0 height=10.0", "must be as in 'caves seed=0"),
        ("caves seed=0 gap=1e999 width=10.0 height=10.0", "gap = inf"),
        ("caves seed=0 gap=1..0 width=10.0 height=10.0", "must be as in 'caves seed=0"),
        ("caves seed=9999999999 gap=1.0 width=10.0 height=10.0", "seed = 9999999999"),
        ("caves seed=0 gap=1.0 width=1e9 height=10.0", "width, height = "),
    ],
)
def test_a_name_that_draws_no_map_is_refused(name, said):
    with pytest.raises(InvalidInput, match=said):
        random_map(name)


def test_the_command_writes_the_game_and_its_map(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    name = "it's: a #1"
    write = ["arena", "random", "--kind", "caves", "--seed", "4", "--size", "9", "8", "--out", f"{name}.toml"]
    assert main(write) == 0
    assert "caves, a map of 72 x 64 cells" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.toml", f"{name}.yaml", f"{name}.pgm"}
    game, drawn = load_game(tmp_path / f"{name}.toml"), random_arena("caves", 4, width=9.0, height=8.0)
    np.testing.assert_array_equal(game.arena.map.field, drawn.map.field)
    assert (game.arena.x_max, game.arena.y_max) == (drawn.x_max, drawn.y_max) == (9.0, 8.0)
    assert main(["arena", "check", f"{name}.toml"]) == 0
    (tmp_path / f"{name}.toml").unlink()
    capsys.readouterr()
    assert main(write) == 2
    assert f"{name}.yaml" in capsys.readouterr().err
    assert main([*write, "--force"]) == 0
