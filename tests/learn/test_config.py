"""Training configurations: what cannot be trained is refused, and a file brings back what was saved."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from apollonius.agents.disturbance import Disturbance
from apollonius.agents.trained import find_trained
from apollonius.arenas.record import to_dict
from apollonius.io.errors import InvalidInput
from apollonius.learn.config import PRESETS, RunConfig
from apollonius.learn.folder import create_run, load_config
from apollonius.learn.learner_config import PROFILES, DQNConfig
from apollonius.learn.stage_config import SelfPlayConfig, StageConfig
from tests.documents import REPOSITORY

SMALL = {"games": 128, "n_step": 16, "env_steps_per_update": 128}


@pytest.mark.parametrize(
    ("kind", "values", "named"),
    [
        (DQNConfig, {"batch": 0}, "batch = 0 .*more than 0"),
        (DQNConfig, {"width": -1}, "width = -1 .*more than 0"),
        (DQNConfig, {"learning_rate": math.nan}, "learning_rate = nan .*more than 0"),
        (DQNConfig, {"replay_capacity": 10**12}, "replay_capacity = 1000000000000 .*at least 1"),
        (DQNConfig, {"batch": 10**12}, "batch = 1000000000000 .*at least 1"),
        (DQNConfig, {"depth": 10**6}, "depth = 1000000 .*at most 64"),
        (DQNConfig, {"width": 10**6}, "width = 1000000 .*at most 8,192"),
        (StageConfig, {"evaluation_games": 10**10}, "evaluation_games = 10000000000 .*at least 1"),
        (DQNConfig, {"gamma": 1.01}, "gamma = 1.01 .*between 0 and 1"),
        (DQNConfig, {"averaging": 0.0}, "averaging = 0.0 .*more than 0 and at most 1"),
        (DQNConfig, {"final_epsilon": -0.1}, "final_epsilon = -0.1 .*between 0 and 1"),
        (DQNConfig, {"n_step": 3, "final_n_step": 4}, "final_n_step = 4 .*at most n_step = 3"),
        (DQNConfig, {"games": 64, "env_steps_per_update": 96}, "env_steps_per_update = 96 .*games = 64"),
        (DQNConfig, SMALL | {"replay_capacity": 4000}, "replay_capacity = 4000 .*at least 4352"),
        (StageConfig, {"env_steps": 0}, "env_steps = 0 .*more than 0"),
        (StageConfig, {"env_steps": 10, "evaluation_games": 0}, "evaluation_games = 0 .*more than 0"),
        (SelfPlayConfig, {"snapshots": 0}, "snapshots = 0 .*from 1 to 100"),
        (RunConfig, {"evaders": ("random",)}, "evaders = random .*stages is 'fixed-target'"),
        (StageConfig, {"progress": float("nan")}, "progress = nan .*finite"),
        (StageConfig, {"progress": -1.0}, "progress = -1.0 .*at least 0"),
        (StageConfig, {"failure": float("inf")}, "failure = inf .*finite"),
        (SelfPlayConfig, {"zero_sum_within": 0.0}, "zero_sum_within = 0.0 .*more than 0 and finite"),
        (SelfPlayConfig, {"zero_sum_within": math.inf}, "zero_sum_within = inf .*more than 0 and finite"),
        (DQNConfig, {"observation": "raster"}, "observation = raster .*paper, encoded, egocentric"),
        (RunConfig, {"seed": 2**32}, "seed = 4294967296 .*at least 0"),
        (RunConfig, {"stages": "both", "pursuer": "P_stage1"}, "pursuer = P_stage1 .*one stage"),
    ],
)
def test_what_cannot_be_trained_is_refused(kind, values, named):
    with pytest.raises(InvalidInput, match=named):
        kind(**values)


def test_the_replay_that_is_asked_for_is_enough():
    assert DQNConfig(**SMALL, replay_capacity=4352).rows == 34


ASYMMETRIC = replace(PRESETS["quick"], self_play=SelfPlayConfig(zero_sum_within=2.0))


@pytest.mark.parametrize("config", [*PRESETS.values(), ASYMMETRIC], ids=[*PRESETS, "asymmetric"])
def test_a_config_comes_back_from_its_file(config, tmp_path):
    create_run(config, tmp_path / "run")
    assert load_config(tmp_path / "run" / "config.toml") == config


def test_a_table_that_is_given_in_part_keeps_the_defaults_of_its_own_stage(tmp_path):
    path = tmp_path / "config.toml"
    path.write_text("[self_play]\nevaluations = 3\n")
    assert load_config(path) == replace(RunConfig(), self_play=SelfPlayConfig(evaluations=3))


def test_the_example_with_disturbed_robots_is_what_it_says_and_comes_back_from_its_file(tmp_path):
    config = load_config(Path(__file__).parents[2] / "examples" / "robust.toml")
    noise = {"position_noise": 0.01, "speed_noise": 0.01, "heading_noise": 0.01}
    assert config.self_play.disturbance == Disturbance(delay=1, limits=0.1, turn_time=0.6, **noise)
    create_run(config, tmp_path / "run")
    assert load_config(tmp_path / "run" / "config.toml") == config


def shared(one, other):
    """Return what a config says of the numbers that another one has, too."""
    return {
        name: shared(value, other[name]) if isinstance(value, dict) else value
        for name, value in one.items()
        if name in other
    }


@pytest.mark.parametrize(
    ("example", "agents"),
    [
        ("prioritised", ("P_prioritised", "E_prioritised")),
        ("robust", ("P_robust", "E_robust")),
        ("team", ("P_team",)),
    ],
)
def test_an_example_is_what_agents_of_the_zoo_were_trained_by(example, agents):
    config = to_dict(load_config(Path(__file__).parents[2] / "examples" / f"{example}.toml"))
    for name in agents:
        record = find_trained(name)[0].header.training["config"]
        assert shared(config, record) == shared(record, config)
        assert {"self_play", "dqn", "game"} <= set(shared(config, record))


@pytest.mark.parametrize(
    ("games", "env_steps_per_update", "steps", "updates"),
    [(64, 64, 1, 1), (64, 256, 4, 1), (64, 16, 1, 4), (1, 1, 1, 1)],
)
def test_a_round_plays_and_updates_in_the_ratio_that_is_asked_for(games, env_steps_per_update, steps, updates):
    config = DQNConfig(games=games, env_steps_per_update=env_steps_per_update)
    assert (config.steps_per_iteration, config.updates_per_iteration) == (steps, updates)
    assert config.env_steps_per_iteration == env_steps_per_update * updates


def test_the_zero_sum_part_of_a_stage_is_its_own_or_else_the_games():
    game = PRESETS["quick"].game
    bounded = replace(game, reward=replace(game.reward, zero_sum_within=4.0))
    assert ASYMMETRIC.self_play.rewarded(game).reward.zero_sum_within == 2.0
    assert ASYMMETRIC.self_play.rewarded(bounded).reward.zero_sum_within == 2.0
    assert SelfPlayConfig().rewarded(bounded).reward.zero_sum_within == 4.0
    assert SelfPlayConfig().rewarded(game) == replace(game, reward=replace(game.reward, progress=1.0))


def test_the_paper_profile_is_plain_dqn():
    paper = PROFILES["paper"]
    assert (paper.observation, paper.double, paper.n_step, paper.averaging) == ("paper", False, 1, 1.0)
    assert (paper.width, paper.depth, paper.learning_rate, paper.gamma) == (256, 4, 1e-4, 0.99)


def test_the_training_that_the_site_reports_is_the_quick_one():
    assert load_config(REPOSITORY / "docs" / "results" / "demo" / "config.toml") == PRESETS["quick"]
