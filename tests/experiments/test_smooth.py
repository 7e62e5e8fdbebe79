"""Continuous agents beside discrete ones: matches go on where they were stopped, and seeds become means."""

import json

import jax.numpy as jnp
import pytest

from apollonius.experiments import smooth
from apollonius.experiments.smooth_report import CONTINUOUS, is_continuous, table, turn_rates, write_results
from apollonius.game.types import Role
from apollonius.learn.learner_config import SACConfig


def match(wins, capture, changes):
    return {
        "pursuer_win_rate": wins,
        "mean_capture_steps": capture,
        "capture_steps_deviation": capture and capture / 2,
        "pursuer_change": (changes, 2 * changes),
        "evader_change": (0.0, 0.1),
    }


def test_a_table_has_a_row_for_each_pairing_and_means_over_seeds():
    rows = {
        "P_zoo": {"random": match(0.5, None, 0.3), "continuous seed-0": match(0.2, 50.0, 0.3)},
        "continuous seed-0": {"random": match(0.6, 100.0, 0.02), "continuous seed-0": match(0.4, 80.0, 0.01)},
        "continuous seed-1": {"random": match(0.8, 120.0, 0.04), "continuous seed-0": match(0.4, 80.0, 0.01)},
    }
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table(rows, dt=0.1).splitlines()][2:]
    assert [line[:2] for line in lines] == [
        ["P_zoo", "random"], ["P_zoo", CONTINUOUS], [CONTINUOUS, "random"], [CONTINUOUS, CONTINUOUS],
    ]  # fmt: skip
    assert lines[0][2:] == ["50.0", "-", "-", "0.450", "0.050"]
    # Two seeds, 60 and 80: Student's t with one degree of freedom times the standard error of 10.
    assert lines[2][2] == f"70.0 ± {12.706 * 10:.1f}"
    assert lines[2][3].startswith("11.0 ±")
    assert lines[3][2] == "40.0 ± 0.0"


def test_everyone_trains_alike_but_for_the_seed_and_meets_the_zoo(tmp_path):
    one, other = (smooth.run_config(seed, 100_000, 200_000) for seed in (0, 1))
    assert isinstance(one.learner, SACConfig)
    assert (one.seed, other.seed, one.learner, one.stages) == (0, 1, other.learner, "both")
    found = smooth.entrants([tmp_path / "seed-0"], Role.EVADER)
    assert list(found) == ["random", "E_curriculum", "E_scratch", "continuous seed-0"]
    assert found["continuous seed-0"].endswith("seed-0/agents/E_curriculum.safetensors")
    assert [is_continuous(name) for name in found] == [False, False, False, True]


@pytest.mark.slow
def test_matches_that_were_stopped_go_on_and_results_are_written(tmp_path):
    path, evaders = smooth.matches_file(tmp_path, "P_stage1"), {"still": "still", "random": "random"}
    assert not smooth.play_row(path, "P_stage1", evaders, 6, lambda: True)
    asked = iter((False, True))
    assert not smooth.play_row(path, "P_stage1", evaders, 6, lambda: next(asked))
    kept = json.loads(path.read_text())
    assert list(kept) == ["still"]
    assert smooth.play_row(path, "P_stage1", evaders, 6, lambda: False)
    row = json.loads(path.read_text())
    assert row["still"] == kept["still"]
    assert row["random"]["games"] == 6
    # A discrete agent under a continuous name draws the figure as well.
    rows = {"P_stage1": row, "continuous seed-0": row}
    written = write_results(tmp_path, rows, dict.fromkeys(rows, "P_stage1"), {"still": "still"})
    assert (tmp_path / "smooth.md").read_text() == written + "\n"
    assert (tmp_path / "smooth.png").stat().st_size > 10_000


def test_turn_rates_are_read_from_either_kind_of_actions():
    assert turn_rates(jnp.array([[8, 0], [3, 4]])).tolist() == [1, -1]
    assert turn_rates(jnp.array([[[0, 0.5], [1, 1]]])).tolist() == [0.5]
