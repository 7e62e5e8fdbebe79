"""Matches that are kept are read back whole, and only where they are the ones that were asked for."""

import json
from dataclasses import replace

import pytest

from apollonius.agents.chasing import PurePursuit
from apollonius.agents.classical import Still
from apollonius.agents.kind import Named, fingerprint
from apollonius.catalogue import find_player
from apollonius.cli import main
from apollonius.errors import InvalidInput
from apollonius.evaluate import match_cache
from apollonius.evaluate.match import Match, StartFilter, play_match
from apollonius.evaluate.match_cache import cached_match, match_file
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
def test_another_match_in_its_place_is_refused_and_stays(folder, other):
    path = match_file(folder, "pure-pursuit", "flee")
    before = path.read_bytes()
    with pytest.raises(InvalidInput, match="other players, rules, games or starts: choose another folder"):
        cached_match(folder, replace(MATCH, **other))
    assert path.read_bytes() == before


@pytest.mark.parametrize("content", ["", "{", "[]", "{}", '{"asked": {}, "result": {}}', '{"asked": {}, "result": 3}'])
def test_a_bad_file_is_refused_with_its_remedy(folder, content):
    path = match_file(folder, "pure-pursuit", "flee")
    path.write_text(content)
    with pytest.raises(InvalidInput, match="remove it"):
        cached_match(folder, MATCH)
    assert path.read_text() == content


def test_fingerprints_tell_players_apart():
    same = find_player("pure-pursuit", Role.PURSUER, GAME).policy
    assert isinstance(same, PurePursuit)
    assert fingerprint(same) == fingerprint(PURSUER.policy)
    others = [find_player(name, Role.PURSUER, GAME).policy for name in ("intercept", "P_stage1", "P_curriculum")]
    assert len({fingerprint(policy) for policy in (same, *others)}) == 4


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
    assert [path.name for path in tmp_path.iterdir()] == ["latest-seed-0--shielded-flee.json"]


def test_the_command_keeps_its_matches_and_refuses_a_file(tmp_path, capsys):
    command = ["tournament", "--pursuers", "random", "--evaders", "still", "--games", "20", "--json"]
    assert main([*command, "--keep", str(tmp_path / "kept")]) == 0
    first = json.loads(capsys.readouterr().out)
    path = match_file(tmp_path / "kept", "random", "still")
    written = path.stat().st_mtime_ns
    assert main([*command, "--keep", str(tmp_path / "kept")]) == 0
    assert json.loads(capsys.readouterr().out) == first
    assert path.stat().st_mtime_ns == written
    with pytest.raises(SystemExit, match="2"):
        main([*command, "--keep", str(path)])
    assert "--keep" in capsys.readouterr().err
