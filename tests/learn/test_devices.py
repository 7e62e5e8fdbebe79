"""One training on two devices: the same networks on both, games of their own, and the curve of one device."""

import json
import os
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.store import load_agent
from apollonius.cli import main
from apollonius.errors import InvalidInput
from apollonius.game.types import Outcome, Role
from apollonius.learn import dqn, replay_buffer
from apollonius.learn.devices import share
from apollonius.learn.folder import create_run
from apollonius.learn.learner_config import SACConfig
from apollonius.learn.opponents import archive as archives
from apollonius.learn.opponents.opponent_config import OpponentConfig
from apollonius.learn.run import Run
from apollonius.learn.stage_config import SelfPlayConfig
from apollonius.learn.train_state import DEVICE_AXIS, Plan
from tests.learn.test_opponents import GAMES, archive_of
from tests.learn.tiny import CHUNK, DQN, RUN, SMALL

REPOSITORY = Path(__file__).parents[2]
PAST = OpponentConfig(scheme="uniform", versions=4, seats=2, renewal=CHUNK)
SAC = SACConfig(**SMALL, learning_starts=CHUNK)
CONFIG = replace(RUN, stages="self-play", self_play=replace(RUN.self_play, env_steps=3 * CHUNK, opponents=PAST))


TRAIN = """
import sys
from pathlib import Path

import jax

folder, halt, *together = sys.argv[1:]
if together:
    jax.distributed.initialize(together[0], 2, int(together[1]))
from apollonius.learn.folder import load_config
from apollonius.learn.run import Run

asked = iter(range(1, 100))
Run(load_config(Path(folder) / "config.toml"), Path(folder), should_stop=lambda: next(asked) == int(halt)).execute()
"""
"""Trains the run of a folder, or a part of it: to the end of this chunk."""


def begin(folder, devices, halt=0, *together):
    """A process with so many devices that trains."""
    environment = os.environ | {
        "PYTHONPATH": str(REPOSITORY),
        "XLA_FLAGS": f"--xla_force_host_platform_device_count={devices}",
        # Of several processes only the first keeps compilations: it would not wait for the others to make theirs.
        "JAX_COMPILATION_CACHE_DIR": "" if together else str(jax.config.jax_compilation_cache_dir),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        "JAX_PLATFORMS": "cpu",
    }
    command = [sys.executable, "-c", TRAIN, str(folder), str(halt), *together]
    return subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)


def ended_well(*processes):
    for process in processes:
        _, errors = process.communicate(timeout=240)
        assert process.returncode == 0, errors


def made(config, folder):
    create_run(config, folder)
    return folder


def together():
    """Two processes that find each other."""
    with socket.socket() as free:
        free.bind(("localhost", 0))
        port = free.getsockname()[1]
    return [(f"localhost:{port}", str(number)) for number in range(2)]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Self-play by one process with two devices, by two processes with one each, and by one device with four seeds."""
    out = tmp_path_factory.mktemp("devices")
    shared = replace(CONFIG, devices=2)
    ended_well(begin(made(shared, out / "devices"), 2))
    made(shared, out / "processes")
    ended_well(*[begin(out / "processes", 1, 0, *one) for one in together()])
    for seed in range(4):
        config = replace(CONFIG, seed=seed)
        assert Run(config, made(config, out / f"one-{seed}")).execute()
    return out


@pytest.mark.slow
@pytest.mark.parametrize(
    "learner", [{"dqn": DQN}, {"sac": SACConfig(**SMALL, learning_starts=CHUNK)}], ids=["dqn", "sac"]
)
def test_a_run_on_two_devices_that_is_stopped_and_resumed_ends_with_the_same_bits(tmp_path, learner):
    """In both stages, with earlier versions in seats."""
    config = replace(RUN, devices=2, self_play=CONFIG.self_play, **learner)
    ended_well(begin(made(config, tmp_path / "whole"), 2))
    broken = made(config, tmp_path / "broken")
    for halt in (2, 4, 0):
        ended_well(begin(broken, 2, halt))
    whole, broken = (
        {path.name: path.read_bytes() for path in (tmp_path / run / "agents").iterdir()} for run in ("whole", "broken")
    )
    assert len(whole) == 9
    assert whole == broken
    assert timeless(tmp_path / "whole") == timeless(tmp_path / "broken")


@pytest.mark.slow
def test_two_processes_that_are_stopped_go_on_where_they_were(runs):
    config = replace(CONFIG, devices=2)
    folder = made(config, runs / "stopped")
    for halt in (2, 0):
        ended_well(*[begin(folder, 1, halt, *one) for one in together()])
    assert timeless(folder) == timeless(runs / "processes")


def lines(run):
    return [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]


def timeless(run):
    return [line | {"seconds": 0, "env_steps_per_second": 0} for line in lines(run)]


@pytest.mark.slow
def test_two_processes_train_what_two_devices_of_one_do(runs):
    for name in ("P_scratch", "E_scratch"):
        one, other = (load_agent(runs / run / "agents" / f"{name}.safetensors") for run in ("devices", "processes"))
        for leaf, same in zip(jax.tree.leaves(one.network), jax.tree.leaves(other.network), strict=True):
            np.testing.assert_allclose(leaf, same, rtol=1e-4, atol=1e-5)
    counts = [[line["outcomes"] for line in lines(runs / run)] for run in ("devices", "processes")]
    assert counts[0] == counts[1]


@pytest.mark.slow
def test_the_curve_is_that_of_one_device(runs):
    """As many env steps and updates, and shares of outcomes that are as near to those of single devices with four seeds
    as these are to each other.
    """
    alone, two = [lines(runs / f"one-{seed}") for seed in range(4)], lines(runs / "devices")
    assert [line["env_steps"] for line in alone[0]] == [line["env_steps"] for line in two]
    assert alone[0][-1]["updates"] == two[-1]["updates"] > 0
    counts = [[sum(line["outcomes"][name] for line in run) for name in two[0]["outcomes"]] for run in (*alone, two)]
    *single, shared = (np.array(of_run) / sum(of_run) for of_run in counts)
    low, high = np.min(single, axis=0), np.max(single, axis=0)
    assert ((low - (high - low) < shared + 0.01) & (shared < high + (high - low) + 0.01)).all()


@pytest.mark.slow
def test_half_the_batch_on_each_of_two_devices_is_one_update_on_the_whole():
    key = jax.random.key(0)
    learner = dqn.init(DQN, key)
    size = learner.network.layers[0].in_features
    batch = replay_buffer.Batch(
        observation=jax.random.normal(key, (16, size)),
        action=jnp.arange(16) % 9,
        reward=jax.random.normal(key, (16,)),
        next_observation=jax.random.normal(jax.random.key(1), (16, size)),
        discount=jnp.full(16, 0.9),
    )
    whole, loss = dqn.update(learner, batch, jnp.asarray(1e-2), DQN)
    halves = jax.tree.map(lambda leaf: leaf.reshape(2, 8, *leaf.shape[1:]), batch)
    update = jax.vmap(
        lambda half: dqn.update(learner, half, jnp.asarray(1e-2), DQN, across=DEVICE_AXIS), axis_name=DEVICE_AXIS
    )
    each, losses = update(halves)
    np.testing.assert_allclose(losses, loss, rtol=1e-5)
    for leaf, expected in zip(jax.tree.leaves(each.network), jax.tree.leaves(whole.network), strict=True):
        np.testing.assert_array_equal(leaf[0], leaf[1])
        np.testing.assert_allclose(leaf[0], expected, rtol=1e-3, atol=1e-4)


def test_the_games_of_all_devices_count():
    """Whoever sits where: two devices with other seats add up what each has seen."""
    before = [replace(archive_of(4), seats=jnp.asarray(seats)) for seats in ([2, 0], [1, 2])]
    outcomes = jax.random.randint(jax.random.key(0), (2, 7, GAMES), 1, len(Outcome))
    over = jnp.ones((2, 7, GAMES), bool)
    alone = [
        archives.record(archive, PAST, Role.EVADER, outcomes[device], over[device])
        for device, archive in enumerate(before)
    ]
    stacked = [jax.tree.map(lambda *leaves: jnp.stack(leaves), *both) for both in (before, alone)]
    both = jax.vmap(lambda *both: archives.added_up(*both, DEVICE_AXIS), axis_name=DEVICE_AXIS)(*stacked)
    for name in ("games", "lost"):
        expected = sum(getattr(archive, name) for archive in alone)
        np.testing.assert_allclose(getattr(both, name), np.stack([expected] * 2), rtol=1e-5)
    assert both.games[0].tolist() == [56, 56, 112, 0]


def test_a_share_has_as_many_updates_of_fewer_games(monkeypatch):
    plan = Plan(DQN, CONFIG.self_play)
    monkeypatch.setattr(jax, "devices", lambda: [None] * 2)
    own = share(plan, 2)
    assert (own.learner.games, own.learner.batch, own.stage.env_steps) == (32, 8, 3 * CHUNK // 2)
    assert own.learner.steps_per_iteration == plan.learner.steps_per_iteration
    assert own.learner.updates_per_iteration == plan.learner.updates_per_iteration
    assert own.learner.rows == plan.learner.rows


def test_what_cannot_be_shared_is_refused(monkeypatch):
    monkeypatch.setattr(jax, "devices", lambda: [None] * 4)
    crowded = SelfPlayConfig(opponents=replace(PAST, seats=8))
    for plan, devices, complaint in (
        (Plan(DQN, SelfPlayConfig()), 3, "games = 64 .* a multiple of 3 devices"),
        (Plan(DQN, crowded), 4, "games = 64 .* more"),
        (Plan(DQN, SelfPlayConfig()), 5, "devices = 5 .* at most 4"),
    ):
        with pytest.raises(InvalidInput, match=complaint):
            share(plan, devices)


def test_more_devices_than_there_are_are_refused_before_anything_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["train", "--devices", "99"]) == 2
    assert "devices = 99 is not possible" in capsys.readouterr().err
    assert main(["train", "--processes", "2"]) == 2
    assert "--coordinator = None is not possible" in capsys.readouterr().err
    assert not any(tmp_path.iterdir())
