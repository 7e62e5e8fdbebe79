"""A tournament: everyone meets everyone on the same starts, and its equilibrium is that of the matrix game."""

import json
import re
from dataclasses import replace

import pytest

from apollonius.agents.classical import Still
from apollonius.agents.kind import Named
from apollonius.catalogue import find_player
from apollonius.cli.main import main
from apollonius.cli.terminal import tournament_table
from apollonius.evaluate import tournament as kept_matches
from apollonius.evaluate.match import Match, play_match
from apollonius.evaluate.start_filter import StartFilter
from apollonius.evaluate.tournament import cached_match, play_tournament
from apollonius.game.by_side import BySide
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput

GAME = replace(make_game("paper"), max_steps=60)


@pytest.fixture(scope="module")
def players():
    pursuers = [find_player(name, Role.PURSUER, GAME) for name in ("random", "pure-pursuit")]
    return pursuers, [find_player(name, Role.EVADER, GAME) for name in ("still", "flee")]


@pytest.fixture(scope="module")
def tournament(players):
    return play_tournament(GAME, *players, games=40, seed=3)


def test_every_cell_is_the_match_of_its_two_players(players, tournament):
    for pursuer, row in zip(players[0], tournament.matches, strict=True):
        for evader, result in zip(players[1], row, strict=True):
            assert result == play_match(Match(GAME, BySide(pursuer, evader), games=40, seed=3))
    assert tournament.win_rates[1, 0] == tournament.matches[1][0].pursuer_win_rate
    assert tournament.win_rates[1, 0] > tournament.win_rates[0, 0]


def test_the_table_has_a_row_for_each_pursuer_and_the_means(tournament):
    table = tournament_table(tournament, "rest")
    assert "Starts: rest." in table
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines() if line.startswith("|")]
    assert cells[0] == ["pursuer \\ evader", "still", "flee", "mean"]
    assert [row[0] for row in cells[2:]] == ["random", "pure-pursuit", "mean"]
    rates = tournament.win_rates
    assert cells[3][1:] == [f"{rate:.1%}" for rate in (*rates[1], rates[1].mean())]
    assert cells[4][3] == f"{rates.mean():.1%}"
    intervals = [match.pursuer_win_interval for row in tournament.matches for match in row]
    assert f"within {50 * max(high - low for low, high in intervals):.1f} points" in table


def test_as_data_it_is_json_with_every_count(tournament):
    data = json.loads(json.dumps(tournament.to_dict()))
    assert [(match["pursuer"], match["evader"]) for match in data["matches"]][2] == ("pure-pursuit", "still")
    assert all(sum(match["outcomes"].values()) == 40 for match in data["matches"])
    assert sum(data["equilibrium"]["pursuers"].values()) == pytest.approx(1)
    skills = [*data["equilibrium"]["pursuer_skill"].values(), *data["equilibrium"]["evader_skill"].values()]
    assert max(skills) == pytest.approx(0, abs=1e-9)
    elo = data["ratings"]["pursuers"]
    assert elo["pure-pursuit"]["low"] > elo["random"]["elo"]
    assert elo["random"]["low"] < elo["random"]["elo"] < elo["random"]["high"]


def test_the_command_draws_the_tournament(tmp_path, capsys):
    arguments = ["tournament", "--pursuers", "random", "--evaders", "still", "--games", "3", "--seed", "1"]
    assert main([*arguments, "--plot", str(tmp_path / "new" / "all.png")]) == 0
    assert (tmp_path / "new" / "all.png").read_bytes().startswith(b"\x89PNG")
    table, told = capsys.readouterr()
    assert table.startswith("| pursuer \\ evader |")
    wrote, then = told.splitlines()[-2:]
    assert wrote.startswith(f"wrote {tmp_path / 'new' / 'all.png'} (")
    assert then == "next: apollonius show random still --out best.gif"
    with pytest.raises(SystemExit):
        main([*arguments, "--plot", str(tmp_path / "all.svg")])
    assert "a file that ends in .png" in capsys.readouterr().err


def test_the_command_refuses_a_player_before_anything_is_played(capsys):
    assert main(["tournament", "--pursuers", "random", "flee"]) == 2
    output, errors = capsys.readouterr()
    assert output == ""
    assert "plays the evader only" in errors
    assert errors.count("\n") == 1


def test_a_side_without_players_or_with_one_twice_is_refused(players):
    pursuers, evaders = players
    with pytest.raises(InvalidInput, match="evaders = none"):
        play_tournament(GAME, pursuers, [], games=1, seed=0)
    with pytest.raises(InvalidInput, match=r"pursuers = random, random .* each once"):
        play_tournament(GAME, pursuers[:1] * 2, evaders, games=1, seed=0)


QUICK_GAME = replace(make_game("paper"), max_steps=40)
PURSUER = find_player("pure-pursuit", Role.PURSUER, QUICK_GAME)
EVADER = find_player("flee", Role.EVADER, QUICK_GAME)
MATCH = Match(QUICK_GAME, BySide(PURSUER, EVADER), 30, 1)


@pytest.fixture
def folder(tmp_path):
    """A folder where one match lies."""
    cached_match(tmp_path / "kept", MATCH)
    return tmp_path / "kept"


def test_a_kept_match_is_the_match_and_is_not_played_again(folder, monkeypatch):
    played = play_match(MATCH)
    monkeypatch.setattr(kept_matches, "play_match", None)
    assert cached_match(folder, MATCH) == played


@pytest.mark.parametrize(
    "other",
    [
        {"game": replace(QUICK_GAME, dt=0.2)},
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


def test_a_tournament_goes_on_from_what_is_kept(folder, monkeypatch):
    players = [PURSUER, find_player("intercept", Role.PURSUER, QUICK_GAME)], [EVADER]
    whole = play_tournament(QUICK_GAME, *players, games=30, seed=1)
    played = []

    def counted(match, **options):
        played.append(type(match.players.pursuer.policy).__name__)
        return play_match(match, **options)

    monkeypatch.setattr(kept_matches, "play_match", counted)
    assert play_tournament(QUICK_GAME, *players, games=30, seed=1, keep=folder) == whole
    assert played == ["Intercept"]


def test_names_of_shielded_players_and_runs_make_files(tmp_path):
    odd = Named("latest/seed-0", PURSUER.policy), Named("shielded:flee", EVADER.policy)
    cached_match(tmp_path, Match(QUICK_GAME, BySide(*odd), 5, 1))
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
