"""`apollonius solve` and `regret`: what they print and keep, and that bad input changes nothing."""

import json
from pathlib import Path

import pytest

from apollonius.solve.store import load_solution
from tests.cli.test_cli import assert_refused, run_main

COARSE, COARSER = ("--grid", "21x21x9x16"), ("--grid", "11x11x3x8")
"""Too coarse for anything but the command itself."""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def run_json(capsys, *arguments):
    assert run_main(*arguments, "--json") == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_safety_says_which_starts_are_lost_and_keeps_the_table(capsys):
    facts = run_json(capsys, "solve", "safety", *COARSE)
    assert facts["grid"] == "21x21x9x16"
    assert facts["hold [s]"] == 0.5
    assert facts["residual"] == 0
    steered = facts["moving starts lost, if it brakes as the table steers"]
    braking = facts["moving starts lost, if it brakes"]
    assert 0.01 < steered <= braking < 0.04
    solution = load_solution(Path(facts["file"]))
    assert facts["file"] == "safety-paper.safetensors"
    assert solution.table.shape == (9, 16, 21, 21)
    assert (solution.problem.kind, solution.problem.role, solution.sweeps) == ("safety", "pursuer", facts["sweeps"])


def test_reach_is_solved_once_and_then_loaded(capsys, monkeypatch):
    arguments = ("solve", "reach", *COARSER, "--out", "tables/six.safetensors", "--target", "6")
    first = run_json(capsys, *arguments, "2")
    assert first["starts with a capture"] > 0.2
    assert first["median time to capture [s]"] > 3
    monkeypatch.setattr("apollonius.solve.solving.solve_reach", None)
    assert run_json(capsys, *arguments, "2") == first
    assert_refused(capsys, *arguments, "3", naming=("tables/six.safetensors", "another problem", "--force"))


@pytest.mark.slow
def test_what_is_there_is_overwritten_only_by_force(capsys):
    Path("t.safetensors").write_text("mine")
    assert_refused(capsys, "solve", "safety", *COARSE, "--out", "t.safetensors", naming=("t.safetensors", "no whole"))
    assert run_json(capsys, "solve", "safety", *COARSE, "--out", "t.safetensors", "--force")["file"] == "t.safetensors"
    assert load_solution(Path("t.safetensors")).problem.kind == "safety"


@pytest.mark.parametrize(
    ("arguments", "naming"),
    [
        (("solve", "reach"), ("--target = None", "X Y for reach")),
        (("solve", "safety", "--target", "1", "1"), ("--target", "left out otherwise")),
        (("solve", "reach", "--target", "3", "3"), ("target = (3.0, 3.0)", "clear of walls and discs")),
        (("solve", "reach", "--target", "6", "2", "--role", "evader"), ("--role = evader", "left out for reach")),
        (("solve", "safety", "--grid", "10x10"), ("grid = 10x10", "101x101x9x47")),
        (("solve", "safety", "--grid", "fine"), ("grid = fine",)),
        (("solve", "safety", "--hold", "0"), ("--hold = 0", "at least 1")),
        (("solve", "safety", "--grid", "9001x9001x99x99"), ("GiB", "fewer nodes")),
        (("regret", "P_stage1", "--starts", "viable"), ("--starts = viable", "rest or moving")),
        (("regret", "E_scratch"), ("E_scratch", "plays the evader")),
    ],
)
def test_what_cannot_be_solved_is_refused(capsys, arguments, naming):
    assert_refused(capsys, *arguments, naming=naming)
