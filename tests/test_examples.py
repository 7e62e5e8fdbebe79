"""Every script in `examples/` runs, as a stranger would run it but smaller."""

import runpy

import jax
import pytest

from tests.documents import REPOSITORY

SCRIPTS = {path.stem: path for path in sorted((REPOSITORY / "examples").glob("*.py"))}
TABLE = (REPOSITORY / "examples" / "README.md").read_text(encoding="utf-8")
SMALL = {
    "as_printed": {"steps": 40, "width": 8, "capacity": 64, "learning_starts": 20, "report_period": 40},
    "evaluate": {"games": 8, "evader": "flee-aware", "pursuers": ("intercept",)},
    "fake_odometry": {"seconds": 5},
    "own_algorithm": {"env_steps": 65_536, "games": 8, "width": 8, "depth": 1, "batch": 16},
    "own_network": {"states": 256, "updates": 2, "games": 8, "width": 8},
    "own_observation": {"games": 8, "degrees": (120,)},
    "own_obstacle": {"games": 8, "pursuer": "intercept", "evader": "flee-aware"},
    "own_reward": {"games": 2},
    "play": {"pursuer": "intercept", "evader": "flee-aware"},
    "solve_reach": {"nodes": (11, 11, 3, 8), "cells": 4},
    "sweep": {"games": 10, "values": 2},
    "train_dqn": {"env_steps": 65_536, "games": 8, "width": 8, "depth": 1, "batch": 16},
}
"""Arguments of `main` with which a script takes seconds; one without any takes seconds as it is."""
FILES = {
    "export_c": {"chase.c", "chase.h"},
    "own_algorithm": {"runs"},
    "own_obstacle": {"round.png"},
    "play": {"game.png", "game.json"},
    "solve_reach": {"reach.png"},
    "train_dqn": {"curve.png", "runs"},
}
"""The files that a script leaves, for those that leave some and need no compiler for it."""
EXTRAS = {"own_reward": "gymnasium"}
LONG = {"as_printed": 250, "own_algorithm": 110}
"""The most lines of a script that has more than 100."""


LENGTHY = ("own_network", "own_obstacle", "solve_reach")
"""Scripts that take ten seconds or more."""


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LENGTHY)) for name in SCRIPTS])
def test_example_runs_prints_and_is_listed(name, tmp_path, monkeypatch, capsys):
    if name in EXTRAS:
        pytest.importorskip(EXTRAS[name])
    monkeypatch.chdir(tmp_path)
    with jax.numpy_dtype_promotion("standard"):
        script = runpy.run_path(str(SCRIPTS[name]))
        script["main"](**SMALL.get(name, {}))
    assert capsys.readouterr().out
    assert FILES.get(name, set()) <= {path.name for path in tmp_path.iterdir()}
    assert f"python examples/{name}.py" in script["__doc__"]
    assert f"[{name}.py]({name}.py)" in TABLE
    assert len(SCRIPTS[name].read_text(encoding="utf-8").splitlines()) <= LONG.get(name, 100)
