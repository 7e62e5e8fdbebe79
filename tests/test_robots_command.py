"""`apollonius robots`: a table, an object or a picture; what no robot can be is refused in one line."""

import json
from pathlib import Path

import pytest

from tests.test_cli import assert_refused, run_main

COMMAND = ("robots", "pure-pursuit", "still", "--speed", "1.5", "1", "--turn", "1", "--radius", "0", "--games", "20")


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_it_prints_a_table(capsys):
    assert run_main(*COMMAND) == 0
    table = capsys.readouterr().out
    assert table.startswith("pure-pursuit (pursuer) against still (evader), 20 games with each make\n")
    assert "radius 0 m, caught within 0.3 m\n    1     1 " in table
    assert max(map(len, table.splitlines())) <= 80
    assert list(Path().iterdir()) == []


def test_it_prints_one_json_object_and_draws(capsys):
    assert run_main(*COMMAND, "--seed", "2", "--json", "--out", "new/robots.png") == 0
    printed, told = capsys.readouterr()
    data = json.loads(printed)
    assert printed.count("\n") == 1
    assert (data["pursuer"], data["evader"], data["game"], data["seed"]) == ("pure-pursuit", "still", "paper", 2)
    assert [make["speed_ratio"] for make in data["makes"]] == [1.0, 1.5]
    assert Path("new/robots.png").read_bytes().startswith(b"\x89PNG")
    assert told.splitlines()[-1].startswith("wrote new/robots.png (")
    assert run_main("evaluate", "pure-pursuit", "still", "--games", "20", "--seed", "2", "--json") == 0
    match = json.loads(capsys.readouterr().out)
    assert {name: match[name] for name in data["own"] if name in match} == {
        name: value for name, value in data["own"].items() if name in match
    }
    assert set(data["own"]) - set(match) == {"speed_ratio", "turn_ratio", "radius"}


@pytest.mark.parametrize(
    ("option", "value", "named"),
    [
        ("--speed", "0", "from 0.01 to 100"),
        ("--speed", "-1", "from 0.01 to 100"),
        ("--turn", "nan", "from 0.01 to 100"),
        ("--turn", "30", "radius 0 m: pursuer.u2_max = 24.0 is not possible"),
        ("--radius", "-0.1", "a length from 0"),
        ("--radius", "6", "radius 6 m: the arena leaves the pursuer no place to start"),
        ("--out", "robots.svg", "ends in .png"),
    ],
)
def test_what_cannot_be_is_refused(capsys, option, value, named):
    assert_refused(capsys, *COMMAND, option, value, naming=("apollonius robots: ", named))
