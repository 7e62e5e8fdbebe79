"""`apollonius pursuers`: what it says, and what it refuses."""

import json

import pytest

from apollonius.cli.main import main
from tests.documents import REPOSITORY


def test_one_obstacle_needs_two(capsys):
    assert main(["pursuers", "one-large", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["pursuers"] == 2
    assert facts["agree"] is True
    assert [graph["islands_seen"] for graph in facts["graphs"]] == [1, 1, 1]
    assert [round(graph["turned_degrees"]) for graph in facts["graphs"]] == [30, 0, 30]
    assert facts["islands"] == 1


def test_an_arena_without_obstacles_needs_one(capsys, tmp_path):
    file = tmp_path / "empty.toml"
    file.write_text("[arena]\ndiscs = []\n")
    assert main(["pursuers", str(file)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == f"{file}: 1 pursuer is enough, for idealised robots on this graph"
    assert len(said) == 6


def test_what_cannot_be_judged_is_refused_in_a_line(capsys):
    assert main(["pursuers", "suite-v1/maze-00,maze-01"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "as suite-v1/maze-00." in said.err
    assert said.err.count("\n") == 1


@pytest.mark.slow
def test_corridors_along_a_dodecahedron_need_three(capsys):
    assert main(["pursuers", str(REPOSITORY / "examples" / "dodecahedron.toml"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["pursuers"] == 3
