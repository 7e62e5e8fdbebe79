"""`apollonius export` and `apollonius arena chart` for agents that play by a chart."""

import re
from pathlib import Path
from shutil import which

import jax
import numpy as np
import pytest

from apollonius.adapters.export.chart_file import PARTS, chart_parts
from apollonius.agents.network import make_network
from apollonius.agents.store import describe, save_agent
from apollonius.arenas.file import load_game
from apollonius.arenas.record import to_dict
from apollonius.cli import main
from apollonius.game.game import Game
from apollonius.game.scenario import in_arenas
from apollonius.game.types import Role

HALL = "[arena]\nx_max = 12.0\npolygons = [{vertices = [[4.0, 4.0], [6.0, 4.0], [5.0, 6.0]]}]\n"


@pytest.fixture(autouse=True)
def small(tmp_path, monkeypatch):
    """A folder of its own with a hall that has a polygon in it, and small evaders by what they read."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("apollonius.adapters.export.writing.STATES", 500)
    Path("hall.toml").write_text(HALL)
    for name in ("egocentric", "team"):
        network = make_network(name, 8, 1, jax.random.key(0))
        save_agent(describe(network, Role.EVADER, to_dict(Game()), {}), Path(f"{name}.safetensors"))


def apollonius(*arguments):
    try:
        return main([*arguments])
    except SystemExit as leaving:
        return leaving.code


@pytest.mark.parametrize(
    ("to", "files"),
    [
        pytest.param("onnx", ["new/evader.onnx"], marks=pytest.mark.slow),
        pytest.param(
            "c",
            ["new/evader.c", "new/evader.chart", "new/evader.h"],
            marks=pytest.mark.skipif(not which("gcc"), reason="gcc"),
        ),
    ],
)
def test_a_policy_is_written_and_checked_in_an_arena_with_a_polygon(capsys, to, files):
    out = next(file for file in files if file.endswith((".onnx", ".c")))
    assert apollonius("export", "egocentric.safetensors", "--to", to, "--out", out, "--game", "hall.toml") == 0
    printed = capsys.readouterr()
    where, checked, timed = printed.out.splitlines()
    assert where == "The evader egocentric of a pursuit-evasion game"
    assert re.fullmatch(r"checked in 500 states of games: \d actions differ from the package's.*", checked)
    assert timed.startswith("one decision, median of 10,000: ")
    assert sorted(map(str, Path("new").iterdir())) == files


def test_the_chart_of_another_map_is_written(capsys):
    assert apollonius("arena", "chart", "hall.toml", "--out", "new/hall.npz") == 0
    assert capsys.readouterr().out == "a square of 12 m from (0, 0) on\n"
    written, drawn = dict(np.load("new/hall.npz")), chart_parts(load_game(Path("hall.toml")))
    said = {name: (array.dtype.name, array.shape) for name, array in written.items()}
    scalars = dict.fromkeys(("x", "y", "side"), ("float32", ()))
    tables = {"field": ("float32", (193,) * 2), "beside": ("uint16", (192,) * 2), "ways": ("uint16", (1600,) * 2)}
    assert said == tables | scalars
    assert all((written[name] == drawn[name]).all() for name in PARTS)
    assert apollonius("arena", "chart", "hall.toml", "--out", "new/hall.chart") == 0
    raw = Path("new/hall.chart").read_bytes()
    assert len(raw) == 5_342_736
    np.testing.assert_array_equal(np.frombuffer(raw, "<f4", 193**2), drawn["field"].ravel())
    assert np.frombuffer(raw[-12:], "<f4").tolist() == [0, 0, 12]


@pytest.mark.parametrize(
    ("agent", "out", "naming"),
    [
        ("team", "a.c", ["observation = team", "paper, encoded, egocentric"]),
        ("team", "a.onnx", ["observation = team", "paper, encoded, egocentric"]),
    ],
)
def test_what_cannot_be_taken_is_refused_in_a_line(capsys, tmp_path, agent, out, naming):
    before = {path.name for path in tmp_path.iterdir()}
    to = {".c": "c", ".onnx": "onnx"}[Path(out).suffix]
    assert apollonius("export", f"{agent}.safetensors", "--to", to, "--out", out) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert [what for what in naming if what not in printed.err] == []
    assert {path.name for path in tmp_path.iterdir()} == before


def test_of_an_agent_for_many_arenas_it_must_be_said_which_one_is_built_in(capsys, monkeypatch):
    many = in_arenas(Game(), [Game().arena, load_game(Path("hall.toml")).arena])
    monkeypatch.setattr("apollonius.adapters.export.writing.game_of", lambda agent, name: many)
    assert apollonius("export", "egocentric.safetensors", "--to", "onnx", "--out", "a.onnx") == 2
    assert re.search("plays in any arena.*--game office", capsys.readouterr().err)
