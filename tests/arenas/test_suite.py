"""The suite of arenas: what was published is what is drawn, in every part, by the commands, and in records."""

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from apollonius.arenas import suite
from apollonius.arenas.file import find_game, game_names
from apollonius.arenas.record import from_dict, to_dict
from apollonius.arenas.suite import PARTS, digest, suite_arena, suite_entries, suite_names
from apollonius.arenas.survey import survey
from apollonius.cli import main
from apollonius.errors import InvalidInput
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.starts import Starts

NAME = "suite-v1"
ENTRIES = {entry.name: entry for entry in suite_entries(NAME)}
DRAWN = [entry for entry in ENTRIES.values() if entry.kind != "gallery"]
TRAIN = {"discs": 64, "blocks": 64, "rooms": 64, "maze": 64}
HELD_OUT = {"racks": 60, "caves": 60}
GALLERY = ("blocks", "courtyard", "maze", "office", "warehouse")
SOME = ["discs-11", "blocks-22", "rooms-33", "maze-44", "racks-07", "caves-07", "office"]


def test_training_and_judging_have_no_kind_of_arenas_in_common():
    kinds = {part: Counter(entry.kind for entry in suite_entries(NAME, part)) for part in PARTS}
    assert kinds == {"train": TRAIN, "held-out": HELD_OUT | {"gallery": 5}}
    assert sum(TRAIN.values()) == 256
    assert len(ENTRIES) == len(suite_names(NAME)) == 256 + 125
    assert suite_names(NAME, "held-out")[-5:] == GALLERY
    assert set(GALLERY) <= set(game_names())


def test_sizes_and_passages_go_together():
    sides = np.array([(entry.width, entry.height) for entry in DRAWN])
    gaps = np.array([entry.gap for entry in DRAWN])
    long = sides.max(axis=1)
    rounding = 0.011
    assert long.min() >= 6 - rounding
    assert long.max() <= 30 + rounding
    assert np.quantile(np.log(long), 0.5) == pytest.approx(np.log(180) / 2, abs=0.15)
    assert (long / sides.min(axis=1)).max() <= 1.5 + rounding
    assert (gaps >= np.maximum(0.8, long / 14) - rounding).all()
    assert (gaps <= long / 7 + rounding).all()


@pytest.mark.parametrize("name", SOME)
def test_each_comes_out_as_it_was_published(name):
    assert digest(suite_arena(NAME, name)) == ENTRIES[name].sha256


def test_arenas_to_learn_in_have_few_obstacles():
    for entry in suite_entries(NAME, "train")[::4]:
        arena = entry.draw()
        assert len(arena.discs) <= 32
        assert len(arena.polygons) <= 64
        assert all(len(polygon.vertices) <= 6 for polygon in arena.polygons)


@pytest.mark.parametrize("name", SOME[:-1])
def test_robots_of_radius_30_cm_go_everywhere(name):
    body = Unicycle(radius=0.3)
    arena = suite_arena(NAME, name)
    game = Game(pursuer=body, evader=body, arena=arena, capture_distance=0.7, starts=Starts(clearance=0.02))
    assert survey(game).wrong == ()


def test_a_digest_is_of_the_numbers_to_a_micrometre_and_of_nothing_else():
    arena = Arena(discs=(Disc(3.0, 0.0, 0.5),))
    assert digest(arena) == digest(Arena(discs=(Disc(3.0, -1e-9, 0.5 + 1e-9),)))
    others = [
        Arena(discs=(Disc(3.0, 0.0, 0.500001),)),
        Arena(x_max=9.0, discs=arena.discs),
        Arena(),
        replace(arena, map=suite_arena(NAME, "caves-00").map),
    ]
    assert len({digest(one) for one in [arena, *others]}) == 5


def test_an_arena_that_comes_out_otherwise_is_refused(monkeypatch):
    entries = (replace(ENTRIES["discs-00"], sha256="0" * 64),)
    monkeypatch.setattr(suite, "_published", lambda suite: entries)
    with pytest.raises(InvalidInput, match=r"SHA-256 of suite-v1/discs-00 = b73cd2122739... .* 000000000000... as pub"):
        suite_arena(NAME, "discs-00")
    assert main(["arena", "suite"]) == 2


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda: suite_arena("suite-v0", "discs-00"), "suite = suite-v0 .* one of suite-v1"),
        (lambda: suite_names(NAME, "test"), "part = test .* one of train, held-out"),
        (lambda: suite_arena(NAME, "racks-99"), "arena of suite-v1 = racks-99 .* arena suite. lists them"),
        (lambda: find_game("suite-v1/"), "no game is called 'suite-v1/': choose .* as 'suite-v1/racks-07'"),
        (lambda: find_game("suite-v1/none"), "arena of suite-v1 = none"),
    ],
    ids=range(5),
)
def test_what_is_not_in_it_is_refused(act, said):
    with pytest.raises(InvalidInput, match=said):
        act()


@pytest.mark.parametrize("name", ["racks-07", "caves-07"])
def test_the_paper_game_there_has_a_record(name):
    game = find_game(f"{NAME}/{name}")
    assert game.pursuer == make_game("paper").pursuer
    assert digest(game.arena) == ENTRIES[name].sha256
    record = json.loads(json.dumps(to_dict(game)))
    again = from_dict(Game, record, "the record")
    assert to_dict(again) == record
    assert digest(again.arena) == digest(game.arena)


@pytest.mark.slow
def test_a_game_in_a_cave_is_played_and_shown_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    play = ["evaluate", "random", "still", "--games", "2", "--record", "1", "--game", f"{NAME}/caves-07"]
    assert main([*play, "--replays", "kept"]) == 0
    (replay,) = (tmp_path / "kept").iterdir()
    assert main(["show", str(replay), "--out", "shown.png"]) == 0
    assert main(["arena", "check", f"{NAME}/caves-07"]) == 0


def test_the_command_lists_verifies_and_draws(tmp_path, monkeypatch, capsys):
    some = tuple(entry for name, entry in ENTRIES.items() if name.endswith(("07", "house")))
    monkeypatch.setattr(suite, "_published", lambda suite: some)
    picture = tmp_path / "new" / "suite.png"
    assert main(["arena", "suite", "--part", "held-out", "--out", str(picture)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[:3] == ["suite-v1/racks-07", "held-out", "racks"]
    assert lines[3] == "3 arenas, all as they were published"
    with Image.open(picture) as drawn:
        assert drawn.width == 3 * 256 + 16
    assert main(["arena", "suite", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [entry["name"] for entry in said["arenas"]] == [entry.name for entry in some]
    assert said["suite"] == NAME
