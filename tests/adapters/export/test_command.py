"""`apollonius export`: what it writes and says, and what it refuses."""

import math
import re
import sys
from pathlib import Path
from shutil import which

import jax
import pytest

from apollonius.adapters.export import onnx as export_onnx
from apollonius.agents.network import make_actor, make_network
from apollonius.agents.store import describe, save_agent
from apollonius.arenas.record import to_dict
from apollonius.cli import main
from apollonius.game.presets import make_game
from apollonius.game.types import Role


@pytest.fixture(autouse=True)
def small(tmp_path, monkeypatch):
    """A folder of its own, with the files of a small evader, of a continuous one, and of one that does not say what it
    was made for.
    """
    monkeypatch.chdir(tmp_path)
    network = make_network("encoded", 8, 1, jax.random.key(0))
    save_agent(describe(network, Role.EVADER, to_dict(make_game("robot")), {}), Path("small.safetensors"))
    save_agent(describe(network, Role.EVADER, {}, {}), Path("silent.safetensors"))
    actor = make_actor("encoded", 8, 1, jax.random.key(0))
    save_agent(describe(actor, Role.EVADER, to_dict(make_game("robot")), {}), Path("smooth.safetensors"))
    return {path.name for path in tmp_path.iterdir()}


def export(*arguments):
    try:
        return main(["export", *arguments])
    except SystemExit as leaving:
        return leaving.code


in_every_format = pytest.mark.parametrize(
    ("to", "files"),
    [
        ("onnx", ["new/evader.onnx"]),
        pytest.param("c", ["new/evader.c", "new/evader.h"], marks=pytest.mark.skipif(not which("gcc"), reason="gcc")),
    ],
)


@in_every_format
def test_a_policy_is_written_and_checked_and_timed_beside_onnxruntime(capsys, to, files):
    assert export("small.safetensors", "--to", to, "--out", files[0]) == 0
    printed = capsys.readouterr()
    where, checked, timed = printed.out.splitlines()
    *wrote, then = printed.err.splitlines()
    assert [line.split(" (")[0] for line in wrote] == [f"wrote {file}" for file in files]
    assert then.endswith("apollonius simulate random small.safetensors --games 300")
    assert where == "The evader small of a pursuit-evasion game"
    assert checked == "checked in 10,000 states of games: 0 actions differ from the package's"
    assert timed.startswith("one decision, median of 10,000: ")
    assert "; onnxruntime, the network alone: " in timed
    assert sorted(map(str, Path("new").iterdir())) == files
    if to != "onnx":
        assert "radius 0.2 m" in Path(files[-1]).read_text(), "the game it was made for"


@in_every_format
def test_a_continuous_policy_is_written_and_checked_and_timed(capsys, to, files):
    assert export("smooth.safetensors", "--to", to, "--out", files[0]) == 0
    where, checked, timed = capsys.readouterr().out.splitlines()
    assert where == "The evader smooth of a pursuit-evasion game"
    said = r"checked in 10,000 states of games: controls differ from the package's by at most \de-0[67] of the largest"
    assert re.fullmatch(said, checked)
    assert re.fullmatch(r"one decision, median of 10,000: [\d.]+ us; onnxruntime, the network alone: [\d.]+ us", timed)
    assert sorted(map(str, Path("new").iterdir())) == files


def test_another_game_is_built_in_where_asked_for(capsys):
    assert export("silent.safetensors", "--to", "c", "--out", "evader.c", "--game", "paper") == 0
    assert "v from 0 to 1.2 m/s, |u1| up to 0.3 m/s^2, |u2| up to 0.8 rad/s, radius 0 m" in Path("evader.h").read_text()


def test_a_game_of_ones_own_is_built_in(capsys):
    Path("hall.toml").write_text("[arena]\nx_max = 12.0\ndiscs = [" + 3 * "{x = 6.0, y = 5.0, radius = 0.8}, " + "]")
    assert export("small.safetensors", "--to", "c", "--out", "evader.c", "--game", "hall.toml") == 0
    assert "X_MAX = 12.0f" in Path("evader.c").read_text()


def test_an_agent_of_the_zoo_becomes_c(capsys, tmp_path):
    assert export("P_pool", "--to", "c", "--out", "P_pool.c") == 0
    if which("gcc"):
        assert ": 0 actions differ from the package's" in capsys.readouterr().out


@pytest.mark.skipif(not which("gcc"), reason="gcc")
def test_what_is_missing_to_compare_is_said(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    assert export("small.safetensors", "--to", "c", "--out", "evader.c") == 0
    assert "; onnxruntime is not installed to compare with: pip install" in capsys.readouterr().out


def test_what_is_missing_to_check_is_said(capsys, monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert export("small.safetensors", "--to", "c", "--out", "evader.c") == 0
    assert capsys.readouterr().out.splitlines()[1:] == ["not checked: there is no gcc here"]
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    assert export("small.safetensors", "--to", "onnx", "--out", "evader.onnx") == 0
    install = "onnxruntime is not installed: pip install onnxruntime (the extra 'export')"
    assert capsys.readouterr().out.splitlines()[1:] == [f"not checked: {install}"]


@pytest.mark.parametrize(
    ("arguments", "naming"),
    [
        (["shielded:P_pool", "--to", "c", "--out", "a.c"], ["shielded:P_pool", "bare player"]),
        (["random", "--to", "c", "--out", "a.c"], ["random", "trained agent"]),
        (["nobody", "--to", "c", "--out", "a.c"], ["nobody", "P_pool"]),
        (["pure-pursuit", "--to", "c", "--out", "a.c"], ["pure-pursuit", "trained agent"]),
        (["small.safetensors", "--to", "c", "--out", "a.c", "--game", "no.toml"], ["no.toml", "check the path"]),
        (["silent.safetensors", "--to", "c", "--out", "a.c"], ["game = None", "silent"]),
        (["small.safetensors", "--to", "c", "--out", "a.c", "--game", "chess"], ["chess", "paper"]),
        (["small.safetensors", "--to", "c", "--out", "a.onnx"], ["--out = a.onnx", ".c"]),
        (["small.safetensors", "--to", "c", "--out", "3.c"], ["3.c", "letter"]),
        (["small.safetensors", "--to", "rust", "--out", "a.rs"], ["rust", "onnx", "c"]),
        (["small.safetensors", "--to", "c"], ["--out"]),
    ],
    ids=" ".join,
)
def test_bad_arguments_are_refused(capsys, small, tmp_path, arguments, naming):
    assert export(*arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert [what for what in naming if what not in printed.err] == []
    assert {path.name for path in tmp_path.iterdir()} == small


def test_onnx_without_its_library_is_refused(capsys, monkeypatch):
    for name in ("onnx", "graph"):
        monkeypatch.delitem(sys.modules, f"apollonius.adapters.export.{name}", raising=False)
    monkeypatch.setitem(sys.modules, "onnx", None)
    assert export("small.safetensors", "--to", "onnx", "--out", "a.onnx") == 2
    assert "the extra 'export'" in capsys.readouterr().err


def test_a_policy_that_decides_otherwise_is_not_written(capsys, small, tmp_path, monkeypatch):
    monkeypatch.setattr(export_onnx, "load", lambda source: lambda state: (0, -0.3, -0.8))
    assert export("small.safetensors", "--to", "onnx", "--out", "a.onnx") == 2
    assert "of 10,000 actions differ from the package's" in capsys.readouterr().err
    assert {path.name for path in tmp_path.iterdir()} == small


@pytest.mark.parametrize(
    ("wrong", "said"), [(2e-4, "by 2e-04 of the largest, more than 1e-04"), (math.nan, "by nan of")]
)
def test_a_continuous_policy_that_steers_otherwise_is_not_written(capsys, small, tmp_path, monkeypatch, wrong, said):
    load = export_onnx.load

    def load_wrong(source):
        decide = load(source)
        u2_max = make_game("robot").evader.u2_max
        return lambda state: (decide(state)[0], decide(state)[1] + wrong * u2_max)

    monkeypatch.setattr(export_onnx, "load", load_wrong)
    assert export("smooth.safetensors", "--to", "onnx", "--out", "a.onnx") == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert f"controls differ from the package's {said}" in printed.err
    assert {path.name for path in tmp_path.iterdir()} == small
