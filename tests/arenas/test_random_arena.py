"""Random arenas: one seed, one arena; every gap is kept, and every robot that fits reaches every place."""

from itertools import combinations
from math import hypot

import pytest

from apollonius.arenas.file import load_game
from apollonius.arenas.random_arena import KINDS, random_arena
from apollonius.arenas.survey import survey
from apollonius.cli import main
from apollonius.errors import InvalidInput
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.validation import check_game


@pytest.mark.parametrize("seed", range(20))
def test_every_gap_is_kept(seed):
    arena = random_arena("discs", seed, gap=0.6, width=12.0, height=8.0, count=8, radius=(0.2, 0.9))
    assert len(arena.discs) == 8
    for disc in arena.discs:
        assert 0.2 <= disc.radius <= 0.9
        assert min(disc.x, 12 - disc.x, disc.y, 8 - disc.y) - disc.radius >= 0.6 - 1e-9
    for one, other in combinations(arena.discs, 2):
        assert hypot(one.x - other.x, one.y - other.y) - one.radius - other.radius >= 0.6 - 1e-9


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
@pytest.mark.parametrize("kind", KINDS)
def test_a_robot_just_thinner_than_the_gap_reaches_everything(kind, seed):
    width, height = ((10.0, 10.0), (14.0, 8.0), (9.0, 16.0), (6.0, 6.0))[seed]
    body = Unicycle(radius=0.47)
    arena = random_arena(kind, seed, gap=1.0, width=width, height=height)
    game = Game(pursuer=body, evader=body, arena=arena, capture_distance=1.0)
    check_game(game)
    assert len(arena.obstacles) >= 1
    found = survey(game)
    assert [parts.max() for parts in found.parts] == [1, 1]
    assert found.wrong == ()


@pytest.mark.parametrize("kind", KINDS)
def test_one_seed_gives_one_arena_and_another_another(kind):
    assert random_arena(kind, 7) == random_arena(kind, 7)
    assert random_arena(kind, 7) != random_arena(kind, 8)
    if kind != "caves":
        assert len({len(random_arena(kind, 0, width=side, height=side).obstacles) for side in (6.0, 12.0, 24.0)}) == 3


def test_there_may_be_none():
    assert random_arena("discs", 0, count=0).obstacles == ()


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ({"count": -1}, "discs = -1"),
        ({"count": 200}, "discs = 200 find no room: after .* ask for fewer"),
        ({"gap": -1.0}, "gap = -1"),
        ({"radius": (0.5, 0.2)}, "radius = .* smallest first"),
        ({"width": 3.0}, "width, height = .* more than 3.6 m"),
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
    capsys.readouterr()
    assert main([*write, "--seed", "3"]) == 2
    assert "--force" in capsys.readouterr().err
    assert load_game(tmp_path / "mine.toml") == game
    assert main([*write, "--force", "--gap", "0.3"]) == 2
    assert "does not fit through" in capsys.readouterr().err
    assert main(["arena", "random", "--kind", "rooms", "--discs", "3", "--out", "rooms.toml"]) == 2
    assert "--discs" in capsys.readouterr().err
    assert main(["arena", "random", "--kind", "rooms", "--seed", "3", "--out", "rooms.json"]) == 0
    assert load_game(tmp_path / "rooms.json").arena == random_arena("rooms", 3)
