"""Matches that are kept are read back whole, and only where they are the ones that were asked for."""

import json
import re
from dataclasses import replace

import pytest

from apollonius.agents.classical import Still
from apollonius.agents.kind import Named
from apollonius.cache import content, digest
from apollonius.catalogue import find_player
from apollonius.cli import main
from apollonius.evaluate import match_cache
from apollonius.evaluate.match import Match, play_match
from apollonius.evaluate.match_cache import cached_match
from apollonius.evaluate.start_filter import StartFilter
from apollonius.evaluate.tournament import play_tournament
from apollonius.game.by_side import BySide
from apollonius.game.presets import make_game
from apollonius.game.types import Role

GAME = replace(make_game("paper"), max_steps=40)
PURSUER = find_player("pure-pursuit", Role.PURSUER, GAME)
EVADER = find_player("flee", Role.EVADER, GAME)
MATCH = Match(GAME, BySide(PURSUER, EVADER), 30, 1)


@pytest.fixture
def folder(tmp_path):
    """A folder where one match lies."""
    cached_match(tmp_path / "kept", MATCH)
    return tmp_path / "kept"


def test_a_kept_match_is_the_match_and_is_not_played_again(folder, monkeypatch):
    played = play_match(MATCH)
    monkeypatch.setattr(match_cache, "play_match", None)
    assert cached_match(folder, MATCH) == played


@pytest.mark.parametrize(
    "other",
    [
        {"game": replace(GAME, dt=0.2)},
        {"games": 31},
        {"seed": 2},
        {"starts": StartFilter.VIABLE},
        {"players": BySide(replace(PURSUER, policy=Still()), EVADER)},
    ],
    ids=lambda other: next(iter(other)),
)
def test_another_match_is_kept_beside_it(folder, other):
    (path,) = folder.iterdir()
    before = path.read_bytes()
    asked = replace(MATCH, **other)
    assert cached_match(folder, asked) == play_match(asked)
    assert len([*folder.iterdir()]) == 2
    assert path.read_bytes() == before


@pytest.mark.parametrize("damage", ["", "{", "[]", "{}", '{"result": 3}', "nan", "other"])
def test_a_bad_file_is_replaced(folder, damage):
    (path,) = folder.iterdir()
    sound = path.read_text()
    damaged = {"nan": sound.replace("0.", "NaN", 1), "other": re.sub(r'("games": )30', r"\g<1>31", sound)}
    path.write_text(damaged.get(damage, damage))
    assert path.read_text() != sound
    assert cached_match(folder, MATCH) == play_match(MATCH)
    assert path.read_text() == sound


@pytest.mark.parametrize("lie", [{"games": 31}, {"pursuer_win_rate": 1.5}, {"arenas": {"wins": [1], "games": [30]}}])
def test_a_result_that_no_match_comes_to_is_replaced(folder, lie):
    (path,) = folder.iterdir()
    sound = path.read_text()
    fields = json.loads(sound)
    fields["result"] |= lie
    path.write_text(json.dumps(fields | {"sha256": digest(fields["result"])}))
    assert cached_match(folder, MATCH) == play_match(MATCH)
    assert path.read_text() == sound


def test_the_contents_of_players_tell_them_apart():
    same = find_player("pure-pursuit", Role.PURSUER, GAME).policy
    others = [find_player(name, Role.PURSUER, GAME).policy for name in ("intercept", "P_stage1", "P_curriculum")]
    assert content(same) == content(PURSUER.policy)
    assert len({content(policy) for policy in (same, *others)}) == 4


def test_a_tournament_goes_on_from_what_is_kept(folder, monkeypatch):
    players = [PURSUER, find_player("intercept", Role.PURSUER, GAME)], [EVADER]
    whole = play_tournament(GAME, *players, games=30, seed=1)
    played = []

    def counted(match, **options):
        played.append(type(match.players.pursuer.policy).__name__)
        return play_match(match, **options)

    monkeypatch.setattr(match_cache, "play_match", counted)
    assert play_tournament(GAME, *players, games=30, seed=1, keep=folder) == whole
    assert played == ["Intercept"]


def test_names_of_shielded_players_and_runs_make_files(tmp_path):
    odd = Named("latest/seed-0", PURSUER.policy), Named("shielded:flee", EVADER.policy)
    cached_match(tmp_path, Match(GAME, BySide(*odd), 5, 1))
    assert [path.name[:-21] for path in tmp_path.iterdir()] == ["latest-seed-0--shielded-flee-"]


def test_the_command_keeps_its_matches_and_refuses_a_file(tmp_path, capsys):
    command = ["tournament", "--pursuers", "random", "--evaders", "still", "--games", "20", "--json"]
    assert main([*command, "--keep", str(tmp_path / "kept")]) == 0
    first = json.loads(capsys.readouterr().out)
    (path,) = (tmp_path / "kept").iterdir()
    written = path.stat().st_mtime_ns
    assert main([*command, "--keep", str(tmp_path / "kept")]) == 0
    assert json.loads(capsys.readouterr().out) == first
    assert path.stat().st_mtime_ns == written
    with pytest.raises(SystemExit, match="2"):
        main([*command, "--keep", str(path)])
    assert "--keep" in capsys.readouterr().err
