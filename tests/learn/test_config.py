"""Training configurations and sweeps: what cannot be trained is refused, and a file brings back what was saved."""

import math
import os
import platform
from dataclasses import asdict, replace
from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.file import find_game
from apollonius.arenas.suite import find_scenario
from apollonius.game.game import Game
from apollonius.game.presets import in_teams, make_game
from apollonius.game.scenario import Spread
from apollonius.game.types import Role
from apollonius.io.document import to_json
from apollonius.io.errors import InvalidInput
from apollonius.learn.algorithm import interpolate_linearly
from apollonius.learn.config import FIXED_TARGET, PRESETS, SELF_PLAY, RunConfig, change_stages, sweep, with_profile
from apollonius.learn.distillation import DistillationConfig
from apollonius.learn.dqn import PROFILES, DQNConfig
from apollonius.learn.fixed_target import FixedTargetConfig
from apollonius.learn.folder import create_run, load_config
from apollonius.learn.ppo import PPOConfig
from apollonius.learn.progress import STATE, ProcessStatus, progress_of, record_status
from apollonius.learn.response import ResponseConfig, Task
from apollonius.learn.sac import SACConfig
from apollonius.learn.self_play import SelfPlayConfig
from tests.documents import REPOSITORY
from tests.learn.tiny import RUN

TEAM = in_teams(make_game("paper"), 2, 1)
WINS, HUNTED = (in_teams(make_game("zero-sum"), *size) for size in ((2, 1), (1, 2)))


TASK = Task(make_game("paper"), ("still", "flee"))


def met_by(scheme, **numbers):
    return {"stages": (SelfPlayConfig(opponents=scheme, **numbers),)}


STAGE_1 = (FixedTargetConfig(),)
SMALL = {"games": 128, "n_step": 16, "env_steps_per_update": 128}


@pytest.mark.parametrize(
    ("kind", "values", "named"),
    [
        (DQNConfig, {"batch": 0}, "batch = 0 .*more than 0"),
        (DQNConfig, {"learning_rate": math.nan}, "learning_rate = nan .*more than 0"),
        (DQNConfig, {"replay_capacity": 10**12}, "replay_capacity = 1000000000000 .*at least 1"),
        (DQNConfig, {"n_step": 2**31}, "n_step = 2147483648 .* at most 2,147,483,647"),
        (PPOConfig, {"epochs": 10**12}, "epochs = 1000000000000 .* at most 2,147,483,647"),
        (RunConfig, met_by("uniform", versions=10**9), "versions = 1000000000 needs .* GiB of memory"),
        (DQNConfig, {"depth": 10**6}, "depth = 1000000 .*from 1 to 64"),
        (DQNConfig, {"width": 10**6}, "width = 1000000 .*from 1 to 8,192"),
        (FixedTargetConfig, {"evaluation_games": 10**10}, "evaluation_games = 10000000000 .*at least 1"),
        (DQNConfig, {"gamma": 1.01}, "gamma = 1.01 .*from 0 to 1"),
        (DQNConfig, {"averaging": 0.0}, "averaging = 0.0 .*more than 0"),
        (DQNConfig, {"final_epsilon": -0.1}, "final_epsilon = -0.1 .*from 0 to 1"),
        (DQNConfig, {"n_step": 3, "final_n_step": 4}, "final_n_step = 4 .*at most n_step = 3"),
        (DQNConfig, {"games": 64, "env_steps_per_update": 96}, "env_steps_per_update = 96 .*games = 64"),
        (DQNConfig, SMALL | {"replay_capacity": 4000}, "replay_capacity = 4000 .*at least 4352"),
        (FixedTargetConfig, {"env_steps": 0}, "env_steps = 0 .*from 1 to"),
        (FixedTargetConfig, {"env_steps": 10, "evaluation_games": 0}, "evaluation_games = 0 .*more than 0"),
        (SelfPlayConfig, {"snapshots": 0}, "snapshots = 0 .*from 1 to 100"),
        (FixedTargetConfig, {"progress": -1.0}, "progress = -1.0 .*from 0 to"),
        (FixedTargetConfig, {"failure": float("inf")}, "failure = inf .*from 0 to"),
        (DQNConfig, {"observation": "raster"}, "unknown observation .raster.; .*paper, encoded, egocentric"),
        (RunConfig, {"seed": 2**32}, "seed = 4294967296 .*at least 0"),
        (RunConfig, {"stages": ()}, "stages = none .*one at least"),
        (RunConfig, {"stages": STAGE_1, "evader": "E_scratch"}, "evader = E_scratch .*left out where no evader"),
        (
            RunConfig,
            {"stages": (DistillationConfig(),), "game": TEAM},
            "robots = 2 v 1 .* a distillation by tables",
        ),
        (RunConfig, {"algorithm": SACConfig(), "game": TEAM}, "robots = 2 v 1 .* 'sac', .* knows"),
        (RunConfig, {"game": WINS, "stages": STAGE_1}, "reward.profile = zero-sum .*'paper'"),
        (RunConfig, {"game": WINS, "stages": (SelfPlayConfig(),)}, "reward.profile = zero-sum .*'paper'"),
        (RunConfig, {"game": HUNTED, "stages": (SelfPlayConfig(),)}, "reward.profile = zero-sum .*'paper'"),
        (SACConfig, {"noise_steps": 0}, "noise_steps = 0 .*a multiple of env_steps_per_update"),
        (SACConfig, {"noise_steps": 6, "env_steps_per_update": 4096}, "noise_steps = 6 .*a multiple"),
        (SelfPlayConfig, {"opponents": "newest"}, "opponents = newest .*one of latest, uniform"),
        (SelfPlayConfig, {"past_share": 0.0}, "past_share = 0.0"),
        (SelfPlayConfig, {"versions": 0}, "versions = 0"),
        (SelfPlayConfig, {"renewal": 0}, "renewal = 0"),
        (RunConfig, met_by("prioritised-hard", renewal=511_999), r"renewal = 511999 .* = 512,000"),
        (DistillationConfig, {"opponents": ()}, "opponents = none"),
        (DistillationConfig, {"clearance": -0.1}, "clearance = -0.1"),
        (DistillationConfig, {"far_sighted": -1}, "far_sighted = -1"),
        (DistillationConfig, {"grid": (3, 3)}, "four numbers of nodes"),
        (DistillationConfig, {"updates": 0}, "updates = 0"),
        (DistillationConfig, {"randomise": (Spread(("pursuer.v_max",), 1.0, 2.0),)}, "randomise = "),
        (ResponseConfig, {"initial_weight_share": 1.5}, "initial_weight_share = 1.5"),
        (ResponseConfig, {"restart_fraction": 1.5}, "restart_fraction = 1.5"),
        (PPOConfig, {"hold": 0.5}, "hold = 0.5"),
        (ResponseConfig, {"tasks": (TASK,)}, "tasks: opponents = given .* 1 names"),
        (FixedTargetConfig, {"time_limit": 0}, "time_limit = 0"),
        (DQNConfig, {"exploration_steps": 0}, "exploration_steps = 0"),
        (RunConfig, {"stages": (DistillationConfig(),), "algorithm": SACConfig()}, "algorithm = sac .*'distillation'"),
        (RunConfig, {"stages": (ResponseConfig(),)}, "algorithm = dqn .*'response'"),
        (
            RunConfig,
            {"stages": (DistillationConfig(),), "algorithm": DQNConfig(games=256)},
            "games = 256 .*than the",
        ),
    ],
)
def test_configs_refuse_impossible_values(kind, values, named):
    with pytest.raises(InvalidInput, match=named):
        kind(**values)


def test_dqn_profiles_have_the_documented_numbers():
    names = "observation double n_step final_n_step games batch env_steps_per_update learning_rate final_learning_rate"
    names += " target_period averaging width depth gamma"
    found = {profile: [getattr(config, name) for name in names.split()] for profile, config in PROFILES.items()}
    assert found == {
        "fast": ["encoded", True, 16, 4, 512, 256, 512, 5e-4, 2e-5, 128_000, 3e-4, 256, 4, 0.99],
        "paper": ["paper", False, 1, 1, 1, 32, 1, 1e-4, 1e-4, 30_000, 1, 256, 4, 0.99],
    }


def test_paper_profile_changes_dqn_and_stage_1_only():
    config = with_profile(RunConfig(), "paper")
    assert config.algorithm is PROFILES["paper"]
    assert config.stages[1] == RunConfig().stages[1]
    trained, judged = config.stages[0].game_of_training(config.game), config.game
    assert (trained.max_steps, judged.max_steps, trained.reward.progress) == (200, 1000, 10)
    assert with_profile(RunConfig(), "fast") == RunConfig()


def test_exploration_steps_are_independent_of_the_stage_length():
    config = DQNConfig(exploration_steps=1000, final_epsilon=0.1)
    shares = [float(config.exploration(1.0, stage, jnp.array(500))) for stage in (2000, 10**7)]
    np.testing.assert_allclose(shares, 0.55, rtol=1e-6)


def test_configs_at_their_limits_are_accepted():
    assert DQNConfig(**SMALL, replay_capacity=4352).rows == 34
    RunConfig(**met_by("uniform", renewal=512_000))
    RunConfig(**met_by("latest", renewal=1))
    RunConfig(game=HUNTED, stages=STAGE_1)  # its game is over when it is out


@pytest.mark.parametrize("config", PRESETS.values(), ids=PRESETS)
def test_config_survives_its_file(config, tmp_path):
    create_run(config, tmp_path / "run")
    assert load_config(tmp_path / "run" / "config.toml") == config


def test_example_recipes_load_as_configs(monkeypatch):
    few = find_scenario("suite-v1/discs-00,discs-01")
    monkeypatch.setattr("apollonius.arenas.file.find_scenario", lambda name: few)  # hundreds take their time
    for name in ("any_chase", "evader", "magnet", "optimal_evader", "pursuer", "response", "robust"):
        assert load_config(REPOSITORY / "examples" / "recipes" / f"{name}.toml") != RunConfig()
    tasks = load_config(REPOSITORY / "examples" / "recipes" / "pursuer.toml").stages[0].tasks
    assert make_game("zero-sum") in [task.game for task in tasks], "with its discs"


def test_config_takes_a_game_by_name_or_table_and_fills_in_defaults(tmp_path):
    path = tmp_path / "config.toml"
    for text, config in (
        ('game = "team-3v1"', RunConfig(game=make_game("team-3v1"))),
        ('game = "team-2v1/blocks"', RunConfig(game=find_game("team-2v1/blocks"))),
        ("[game]\ndt = 0.05", RunConfig(game=Game(dt=0.05))),
        ('[[stages]]\nkind = "self-play"\nevaluations = 3\n', RunConfig(stages=(SelfPlayConfig(evaluations=3),))),
        ('[algorithm]\nkind = "sac"\nbatch = 8', RunConfig(algorithm=SACConfig(batch=8))),
    ):
        path.write_text(text)
        assert load_config(path) == config
    path.write_text('game = "papre"')
    with pytest.raises(InvalidInput, match="unknown game 'papre'; did you mean 'paper'"):
        load_config(path)


@pytest.mark.parametrize(
    ("games", "env_steps_per_update", "steps", "updates"),
    [(64, 64, 1, 1), (64, 256, 4, 1), (64, 16, 1, 4), (1, 1, 1, 1)],
)
def test_iteration_has_the_configured_ratio_of_steps_to_updates(games, env_steps_per_update, steps, updates):
    config = DQNConfig(games=games, env_steps_per_update=env_steps_per_update)
    assert (config.steps_per_iteration, config.updates_per_iteration) == (steps, updates)
    assert config.env_steps_per_iteration == env_steps_per_update * updates


@pytest.mark.parametrize(
    ("end", "over", "env_steps", "value"),
    [(0.1, 1e3, 0, 1.0), (0.1, 1e3, 250, 0.775), (0.1, 1e3, 10**9, 0.1), (2.0, 10.0, 4, 1.4), (0.1, 0.0, 1, 0.1)],
)
def test_linear_schedule_stays_at_its_end(end, over, env_steps, value):
    assert interpolate_linearly(1.0, end, over=over, env_steps=jnp.asarray(env_steps)) == pytest.approx(value)


def test_sweep_has_every_combination_and_changes_nothing_else():
    runs = sweep(RUN, {"algorithm.batch": [16, 32], "stages.self-play.progress": [1.5, 2], "seed": [0, 3]})
    assert len(runs) == 8
    last = runs["algorithm.batch=32,stages.self-play.progress=2,seed=3"]
    assert (last.algorithm.batch, last.stages[1].progress, last.seed) == (32, 2.0, 3)
    same = runs["algorithm.batch=16,stages.self-play.progress=1.5,seed=0"]
    assert same == change_stages(RUN, SELF_PLAY, progress=1.5)


@pytest.mark.parametrize(("name", "changed"), [("self-play", 1), ("self-play-2", 2)])
def test_sweep_changes_one_of_two_stages_of_a_kind(name, changed):
    longer = replace(RUN, stages=(*RUN.stages, replace(RUN.stages[1], env_steps=4096)))
    (run,) = sweep(longer, {f"stages.{name}.snapshots": [3]}).values()
    stages = list(longer.stages)
    stages[changed] = replace(stages[changed], snapshots=3)
    assert run.stages == tuple(stages)


@pytest.mark.parametrize(
    ("field", "values", "naming"),
    [
        ("algorithm.batsh", [1], "did you mean 'batch'"),
        ("algoritm.batch", [1], "did you mean 'algorithm.batch'"),
        ("stages.self_play.progress", [1], "did you mean 'stages.self-play.progress'"),
        ("stages.self-play.progres", [1], "did you mean 'progress'"),
        ("learning_rate", [1e-3], "move it to"),
        ("algorithm.batch", [0], "batch = 0"),
        ("seed", [1, 1], "different ones"),
        ("seed", range(1001), "at most 1,000"),
    ],
)
def test_sweep_refuses_unknown_fields_and_bad_values(field, values, naming):
    with pytest.raises(InvalidInput, match=naming):
        sweep(RUN, {field: values})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[algorithm]\nbatch = 3", "algorithm: kind = nothing .*one of dqn, sac, ppo"),
        ('[algorithm]\nkind = "dnq"', "algorithm: kind = dnq .*one of dqn, sac, ppo"),
        ('[algorithm]\nkind = "ppo"\nmagnet = true', "magnet = true .* a number"),
        ('[algorithm]\nkind = "ppo"\ncritic_first = 2147483648', "critic_first = 2147483648 .* 2,147,483,647"),
        ('[algorithm]\nkind = "dqn"\nbatsh = 3', "algorithm, dqn: unknown key 'batsh'; did you mean 'batch'"),
        ('[[stages]]\nkind = "selfplay"', "stages: kind = selfplay .*one of fixed-target, self-play"),
        ('[[stages]]\nkind = "self-play"\nevaders = ["still"]', "stages, self-play: unknown key 'evaders'"),
        ('[stages]\nkind = "self-play"', "stages = .*must be a list"),
        ("stages = [3]", "stages"),
        ("algorithm = 3", "algorithm"),
    ],
)
def test_config_names_the_stage_or_algorithm_that_is_wrong(text, message, tmp_path):
    path = tmp_path / "config.toml"
    path.write_text(text)
    with pytest.raises(InvalidInput, match=message):
        load_config(path)


def test_stages_of_one_kind_have_names_keys_and_agents_of_their_own():
    twice = RunConfig(stages=(FixedTargetConfig(), SelfPlayConfig(), SelfPlayConfig(opponents="uniform")))
    assert list(twice.by_name) == [FIXED_TARGET, SELF_PLAY, "self-play-2"]
    assert [twice.stage_number(name) for name in twice.by_name] == [0, 1, 5]
    names = [twice.agent_name(name, Role.EVADER) for name in (SELF_PLAY, "self-play-2")]
    assert names == ["E_curriculum", "E_curriculum_2"]


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({}, ["P_stage1", "P_curriculum"]),
        ({"stages": (SelfPlayConfig(),)}, ["P_scratch"]),
        ({"stages": (SelfPlayConfig(),), "pursuer": "P_stage1"}, ["P_curriculum"]),
        ({"stages": (FixedTargetConfig(evaders=("random",)),)}, ["P_random"]),
        ({"stages": (FixedTargetConfig(evaders=("a/E_scratch.safetensors",)),)}, ["P_E_scratch"]),
        ({"stages": (FixedTargetConfig(evaders=("random", "still")),)}, ["P_pool"]),
        ({"stages": (DistillationConfig(),)}, ["P_distilled"]),
        ({"stages": (ResponseConfig(),), "algorithm": PPOConfig()}, ["P_response"]),
    ],
)
def test_agents_are_called_by_what_their_stage_taught(changes, names):
    config = RunConfig(**changes)
    assert [config.agent_name(name, Role.PURSUER) for name in config.by_name] == names


@pytest.fixture
def run(tmp_path):
    create_run(RUN, tmp_path / "run")
    return tmp_path / "run"


def test_process_status_records_who_trains_and_how_it_ended(run, monkeypatch):
    monkeypatch.setenv("SLURM_ARRAY_JOB_ID", "7")
    monkeypatch.setenv("SLURM_ARRAY_TASK_ID", "2")

    def fail(error):
        assert progress_of(run).state == ProcessStatus("running", platform.node(), os.getpid(), "7_2")
        raise error

    for error, ended in ((ZeroDivisionError("by zero"), ("failed", "by zero")), (KeyboardInterrupt(), ("stopped", ""))):
        with pytest.raises(type(error)):
            record_status(run, partial(fail, error))
        found = progress_of(run).state
        assert (found.state, found.error) == ended


NOBODY = 2**22 + 1
"""Greater than any process's number."""


@pytest.mark.parametrize(
    ("machine", "process", "state"),
    [(platform.node(), NOBODY, "stopped"), (platform.node(), 1, "running"), ("elsewhere", NOBODY, "running")],
)
def test_run_of_a_vanished_local_process_counts_as_stopped(run, machine, process, state):
    (run / STATE).write_text(to_json(asdict(ProcessStatus("running", machine, process))))
    assert progress_of(run).state.state == state


def test_run_with_unreadable_files_counts_as_failed(run):
    (run / STATE).write_text("garbage")
    found = progress_of(run).state
    assert found.state == "failed"
    assert "state" in found.error
