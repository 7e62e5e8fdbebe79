"""The example of Stable-Baselines3 trains and judges, where that is installed."""

import runpy
from pathlib import Path

import pytest

pytest.importorskip("stable_baselines3")
pytestmark = pytest.mark.slow
EXAMPLE = Path(__file__).parents[2] / "examples" / "stable_baselines.py"


def test_it_trains_and_says_how_many_it_captures(capsys):
    rate = runpy.run_path(str(EXAMPLE))["main"](["--env-steps", "6000", "--games", "2"])
    assert rate in (0, 0.5, 1)
    assert capsys.readouterr().out == f"{rate:.1%} of 2 games captured\n"
