"""Which observation carries over: who is trained for how long, and the table of what comes of it."""

from dataclasses import replace

import pytest

from apollonius.evaluate.by_arena import ByArena
from studies.inputs import FASTER, Inputs, input_table
from tests.studies.matches import NO_MATCH


def result(*wins):
    """Ten games in each of some arenas."""
    rate = sum(wins) / (10 * len(wins))
    return replace(NO_MATCH, pursuer_win_rate=rate, arenas=ByArena(wins, (10,) * len(wins)))


@pytest.mark.slow
def test_what_is_quicker_trains_for_more_steps_in_the_same_time(tmp_path):
    study = Inputs(out=tmp_path, seeds=2, env_steps=1000)
    steps = {folder.name: config.fixed_target.env_steps for folder, (config, _) in study.trainings().items()}
    assert steps["rays-steps-1"] == steps["egocentric-steps-1"] == 1000
    assert steps["rays-time-1"] == 1000 * FASTER["rays"]
    assert "egocentric-time-0" not in steps


def test_a_row_tells_the_mean_over_seeds_the_least_and_the_greatest():
    found = {"rays-steps-0": result(10, 4), "rays-steps-1": result(8, 10), "rays-time-0": result(10, 10)}
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in input_table(found, 2).splitlines()[2:]]
    assert rows == [
        ["rays", "as many env steps", "80.0 [70.0, 90.0]", "60.0 [40.0, 80.0]"],
        ["rays", "as much time", "100.0 [100.0, 100.0]", "100.0 [100.0, 100.0]"],
    ]


@pytest.mark.parametrize("name", FASTER)
def test_each_observation_is_trained_with(tmp_path, name):
    configs = {folder.name: config for folder, (config, _) in Inputs(out=tmp_path, seeds=1).trainings().items()}
    assert configs[f"{name}-steps-0"].dqn.observation == name
