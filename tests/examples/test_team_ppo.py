"""The example of a team that learns from outside trains and judges, where Stable-Baselines3 is installed."""

import runpy
from pathlib import Path

import pytest

pytest.importorskip("stable_baselines3")
pytestmark = pytest.mark.slow
EXAMPLE = Path(__file__).parents[2] / "examples" / "team_ppo.py"


def test_a_team_trains_and_says_how_many_it_captures(capsys):
    asked = ["--game", "team-2v1", "--env-steps", "1000", "--side-by-side", "1", "--games", "2"]
    rate = runpy.run_path(str(EXAMPLE))["main"](asked)
    assert rate in (0, 0.5, 1)
    assert capsys.readouterr().out == f"{rate:.1%} of 2 games captured\n"
