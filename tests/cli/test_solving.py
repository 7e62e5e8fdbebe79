"""`apollonius solve`, what its files are good for (to play, to judge by, to attack with), and `pursuers`."""

import json
from pathlib import Path

import numpy as np
import pytest

from apollonius.solve.store import load_solution
from tests.cli.test_cli import assert_refused, run_main

COARSER = ("--grid", "9x9x3x8")
GRID = ("--grid", "4x4x2x4", "--hold", "10")
"""All too coarse for anything but the commands themselves."""


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tables")
    paths = {role: folder / f"{role}.safetensors" for role in ("pursuer", "evader")}
    for role, path in paths.items():
        assert run_main("solve", "game", "--role", role, *GRID, "--out", str(path)) == 0
    return {role: str(path) for role, path in paths.items()}


def run_json(capsys, *arguments):
    capsys.readouterr()
    assert run_main(*arguments, "--json") == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_a_card_is_measured(capsys, tables):
    files = ("--tables", tables["evader"], tables["pursuer"])
    card = run_json(capsys, "regret", "random", *files, "--role", "evader", "--games", "12")
    assert (card["agent"], card["role"], card["games"]) == ("random", "evader", 12)
    assert card["gap"] == pytest.approx(card["promised"] - card["payoff"], abs=1e-6)
    twice = ("--tables", tables["evader"], tables["evader"])
    assert_refused(capsys, "regret", "random", *twice, naming=("--tables", "a pursuer's and an evader's"))
    assert_refused(capsys, "regret", "random", *files, "--grid", "4x4x2x4", naming=("--grid", "--tables"))
    assert run_main("regret", "still", *files, "--role", "evader", "--games", "5") == 0
    assert "gap to what its own table promises" in capsys.readouterr().out


def test_reach_is_solved_once_and_then_loaded(capsys, monkeypatch):
    arguments = ("solve", "reach", *COARSER, "--out", "tables/six.safetensors", "--target", "6")
    monkeypatch.setattr("apollonius.evaluate.solved.STARTS", 500)
    first = run_json(capsys, *arguments, "2")
    assert first["starts with a capture"] > 0.2
    assert first["median time to capture [s]"] > 3
    with monkeypatch.context() as patch:
        patch.setattr("apollonius.solve.solving.solve_reach", None)
        assert run_json(capsys, *arguments, "2") == first
    assert_refused(capsys, *arguments, "3", naming=("tables/six.safetensors", "another problem", "--force"))
    assert_refused(capsys, *arguments, "3", "--whole-cells", naming=("whole_cells = True", "all but game"))
    Path("t.safetensors").write_text("mine")
    safety = ("solve", "safety", *COARSER, "--out", "t.safetensors")
    assert_refused(capsys, *safety, naming=("t.safetensors", "not a whole"))
    assert run_main(*arguments, "3", "--force") == 0
    assert load_solution(Path("tables/six.safetensors")).problem.target == [6.0, 3.0]


def test_one_obstacle_needs_two(capsys):
    facts = run_json(capsys, "pursuers", "one-large")
    assert (facts["pursuers"], facts["agree"], facts["islands"]) == (2, True, 1)
    assert [graph["islands_seen"] for graph in facts["graphs"]] == [1, 1, 1]
    assert [round(graph["turned_degrees"]) for graph in facts["graphs"]] == [30, 0, 30]
    seen = run_json(capsys, "pursuers", "one-large", "--to-see")
    assert (seen["pursuers"], seen["agree"]) == (2, True)
    assert np.shape(seen["strategy"]) == (seen["graphs"][-1]["turns"] + 1, 2, 2)


def test_an_arena_without_obstacles_needs_one(capsys):
    Path("empty.toml").write_text("[arena]\ndiscs = []\n")
    assert run_main("pursuers", "empty.toml") == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "empty.toml: 1 pursuer is enough, for idealised robots on this graph"
    assert len(said) == 6
