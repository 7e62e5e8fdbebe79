"""`apollonius solve game` and what its files are good for: to play, to judge by, to attack with."""

import json
from pathlib import Path

import pytest

from apollonius.play.replay import load_replay
from apollonius.solve.store import load_solution
from tests.cli.test_cli import assert_refused, run_main

GRID = ("--grid", "4x4x2x4", "--hold", "10")
"""Too coarse for anything but the commands themselves."""


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """The files of both sides, and what was printed about them."""
    folder = tmp_path_factory.mktemp("tables")
    paths = {role: folder / f"{role}.safetensors" for role in ("pursuer", "evader")}
    for role, path in paths.items():
        assert run_main("solve", "game", "--role", role, *GRID, "--out", str(path)) == 0
    return {role: str(path) for role, path in paths.items()}


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def run_json(capsys, *arguments):
    capsys.readouterr()
    assert run_main(*arguments, "--json") == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_the_game_is_solved_once_and_then_loaded(capsys, tables, monkeypatch):
    solution = load_solution(Path(tables["evader"]))
    assert (solution.problem.kind, solution.problem.role) == ("game", "evader")
    monkeypatch.setattr("apollonius.solve.solving.solve_duel", None)
    facts = run_json(capsys, "solve", "game", "--role", "evader", *GRID, "--out", tables["evader"])
    assert (facts["grid"], facts["hold [s]"], facts["sweeps"]) == ("4x4x2x4", 1.0, solution.sweeps)
    assert -1 <= facts["at the worst"] <= facts["the evader's estimate, on average over starts"] <= 1
    assert_refused(
        capsys, "solve", "game", "--role", "pursuer", *GRID, "--out", tables["evader"],
        naming=("evader.safetensors", "another problem", "--force"),
    )  # fmt: skip


@pytest.mark.slow
def test_its_file_is_a_player(capsys, tables):
    match = run_json(capsys, "evaluate", tables["pursuer"], "random", "--games", "20")
    assert match["pursuer"] == "pursuer"
    assert match["pursuer_win_rate"] > match["evader_win_rate"]
    naming = "pursuer = ", "evader.safetensors", "solved for the pursuer"
    assert_refused(capsys, "evaluate", tables["evader"], "random", naming=naming)


@pytest.mark.slow
def test_a_card_is_measured_and_its_worst_games_are_kept(capsys, tables):
    files = ("--tables", tables["evader"], tables["pursuer"])
    options = ("--games", "12", "--record", "2", "--replays", "lost")
    card = run_json(capsys, "regret", "random", *files, "--role", "evader", *options)
    assert (card["agent"], card["role"], card["games"]) == ("random", "evader", 12)
    assert card["gap"] == pytest.approx(card["sure"] - card["payoff"], abs=1e-6)
    kept = [load_replay(path) for path in Path("lost").iterdir()]
    assert {replay.index for replay in kept} == {game["game"] for game in card["worst"][:2]}
    assert {(replay.pursuer, replay.evader) for replay in kept} == {("table", "random")}
    assert run_main("regret", "still", *files, "--role", "evader", "--games", "5") == 0
    assert "gap to its own table's estimate" in capsys.readouterr().out


@pytest.mark.slow
def test_attackers_are_reported_each_and_the_worst_is_judged_on_other_starts(capsys, tables):
    both = ("--tables", tables["pursuer"], tables["evader"])
    kinds = ("--attackers", "table", "search-1", "search-4")
    found = run_json(capsys, "exploit", "evader", "still", *both, *kinds, "--games", "20", "--seed", "4")
    assert (found["agent"], found["side"]) == ("still", "evader")
    assert [one["name"] for one in found["attackers"]] == list(kinds[1:])
    rates = {one["name"]: one["loses"] for one in found["attackers"]}
    assert rates[found["worst"]["name"]] == max(rates.values()) > 0
    for one in [*found["attackers"], found["worst"]]:
        assert one["games"] == 20
        assert one["interval"][0] <= one["loses"] <= one["interval"][1]
        assert one["fails"] == 0, "who stands still fails at nothing"
    again = run_json(capsys, "exploit", "evader", "still", *both, *kinds[:2], "--games", "20", "--seed", "5")
    if found["worst"]["name"] == "table":
        assert again["attackers"][0]["loses"] == found["worst"]["loses"], "judged on the games of the next seed"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("solve", "game", "--target", "1", "2"), ("--target", "left out otherwise")),
        (("regret", "P_stage1", "--role", "robot"), ("--role", "robot")),
        (("regret", "P_stage1", "--record", "11"), ("--record", "from 0 to 10")),
        (("exploit", "pursuer", "P_stage1", "--attackers", "nobody"), ("--attackers", "nobody")),
        (
            ("exploit", "pursuer", "P_stage1", "--tables", "t.safetensors", "e.safetensors"),
            ("--tables = t.safetensors", "check the path"),
        ),
    ],
)
def test_what_does_not_go_together_is_refused(capsys, arguments, words):
    assert_refused(capsys, *arguments, naming=words)


@pytest.mark.slow
def test_tables_are_of_both_sides_and_know_their_grid(capsys, tables):
    twice = ("--tables", tables["evader"], tables["evader"])
    assert_refused(capsys, "regret", "random", *twice, naming=("--tables", "a pursuer's and an evader's"))
    both = ("--tables", tables["pursuer"], tables["evader"])
    assert_refused(capsys, "regret", "random", *both, "--grid", "4x4x2x4", naming=("--grid", "--tables"))
    assert_refused(capsys, "exploit", "evader", "still", *twice, naming=("--tables", "a pursuer's and an evader's"))
