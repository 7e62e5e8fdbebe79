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
import tomli_w

from apollonius.agents.store import load_agent
from apollonius.arenas.record import to_dict
from apollonius.errors import InvalidInput
from apollonius.game.types import Outcome, Role
from apollonius.learn import dqn, opponents, replay
from apollonius.learn.config import SelfPlayConfig
from apollonius.learn.devices import share
from apollonius.learn.folder import create_run
from apollonius.learn.run import Run
from apollonius.learn.scheme import OpponentConfig
from apollonius.learn.state import DEVICES, Plan
from tests.learn.test_opponents import GAMES, archive_of
from tests.learn.tiny import CHUNK, DQN, RUN

REPOSITORY = Path(__file__).parents[2]
PAST = OpponentConfig(scheme="uniform", versions=4, seats=2, renewal=CHUNK)
CONFIG = replace(RUN, stages="self-play", self_play=replace(RUN.self_play, env_steps=3 * CHUNK, opponents=PAST))


def begin(folder, devices, *arguments):
    """A process with so many devices."""
    environment = os.environ | {
        "PYTHONPATH": str(REPOSITORY),
        "XLA_FLAGS": f"--xla_force_host_platform_device_count={devices}",
        # Of several processes only the first keeps compilations: it would not wait for the others to make theirs.
        "JAX_COMPILATION_CACHE_DIR": "" if "--coordinator" in arguments else str(jax.config.jax_compilation_cache_dir),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        "JAX_PLATFORMS": "cpu",
    }
    command = [sys.executable, "-m", "apollonius.experiments.many_devices", "--out", str(folder), *arguments]
    return subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)


def ended_well(*processes):
    for process in processes:
        _, errors = process.communicate(timeout=240)
        assert process.returncode == 0, errors


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Trainings by one process with two devices, by two processes with one each, and by one device with four seeds."""
    out = tmp_path_factory.mktemp("devices")
    (out / "config.toml").write_text(tomli_w.dumps(to_dict(CONFIG)))
    asked = ["--config", str(out / "config.toml")]
    ended_well(begin(out / "devices", 2, *asked))
    with socket.socket() as free:
        free.bind(("localhost", 0))
        port = free.getsockname()[1]
    together = ["--coordinator", f"localhost:{port}", "--processes", "2", "--process"]
    ended_well(*[begin(out / "processes", 1, *asked, *together, str(number)) for number in range(2)])
    for seed in range(4):
        config = replace(CONFIG, seed=seed)
        create_run(config, out / f"one-{seed}")
        assert Run(config, out / f"one-{seed}").execute()
    return out


def lines(run):
    return [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]


@pytest.mark.slow
def test_two_processes_train_what_two_devices_of_one_do(runs):
    for name in ("P_shared", "E_shared"):
        one, other = (load_agent(runs / run / "agents" / f"{name}.safetensors") for run in ("devices", "processes"))
        for leaf, same in zip(jax.tree.leaves(one.network), jax.tree.leaves(other.network), strict=True):
            np.testing.assert_allclose(leaf, same, rtol=1e-4, atol=1e-5)
    timeless = [[line | {"seconds": 0} for line in lines(runs / run)] for run in ("devices", "processes")]
    assert timeless[0] == timeless[1]


@pytest.mark.slow
def test_the_curve_is_that_of_one_device(runs):
    """As many env steps and updates, and shares of outcomes that are as near to those of single devices with four seeds
    as these are to each other.
    """
    alone, two = [lines(runs / f"one-{seed}") for seed in range(4)], lines(runs / "devices")
    assert [line["env_steps"] for line in alone[0]] == [line["env_steps"] for line in two]
    assert alone[0][-1]["updates"] == sum(line["updates"] for line in two) > 0
    counts = [[sum(line["outcomes"][name] for line in run) for name in two[0]["outcomes"]] for run in (*alone, two)]
    *single, shared = (np.array(of_run) / sum(of_run) for of_run in counts)
    low, high = np.min(single, axis=0), np.max(single, axis=0)
    assert ((low - (high - low) < shared + 0.01) & (shared < high + (high - low) + 0.01)).all()


@pytest.mark.slow
def test_half_the_batch_on_each_of_two_devices_is_one_update_on_the_whole():
    key = jax.random.key(0)
    learner = dqn.init(DQN, key)
    size = learner.network.layers[0].in_features
    batch = replay.Batch(
        observation=jax.random.normal(key, (16, size)),
        action=jnp.arange(16) % 9,
        reward=jax.random.normal(key, (16,)),
        next_observation=jax.random.normal(jax.random.key(1), (16, size)),
        discount=jnp.full(16, 0.9),
    )
    whole, loss = dqn.update(learner, batch, jnp.asarray(1e-2), DQN)
    halves = jax.tree.map(lambda leaf: leaf.reshape(2, 8, *leaf.shape[1:]), batch)
    update = jax.vmap(lambda half: dqn.update(learner, half, jnp.asarray(1e-2), DQN, across=DEVICES), axis_name=DEVICES)
    each, losses = update(halves)
    np.testing.assert_allclose(losses, loss, rtol=1e-5)
    for leaf, expected in zip(jax.tree.leaves(each.network), jax.tree.leaves(whole.network), strict=True):
        np.testing.assert_array_equal(leaf[0], leaf[1])
        np.testing.assert_allclose(leaf[0], expected, rtol=1e-3, atol=1e-4)


def test_the_games_of_all_devices_count():
    """Whoever sits where: two devices with other seats add up what each has seen."""
    archives = [replace(archive_of(4), seats=jnp.asarray(seats)) for seats in ([2, 0], [1, 2])]
    outcomes = jax.random.randint(jax.random.key(0), (2, 7, GAMES), 1, len(Outcome))
    over = jnp.ones((2, 7, GAMES), bool)
    alone = [
        opponents.record(archive, PAST, Role.EVADER, outcomes[device], over[device])
        for device, archive in enumerate(archives)
    ]
    stacked = [jax.tree.map(lambda *leaves: jnp.stack(leaves), *both) for both in (archives, alone)]
    both = jax.vmap(lambda *archives: opponents.added_up(*archives, DEVICES), axis_name=DEVICES)(*stacked)
    for name in ("games", "lost", "quality"):
        expected = sum(getattr(archive, name) for archive in alone)
        np.testing.assert_allclose(getattr(both, name), np.stack([expected] * 2), rtol=1e-5)
    assert both.games[0].tolist() == [56, 56, 112, 0]


def test_a_share_has_as_many_updates_of_fewer_games():
    plan = Plan(DQN, CONFIG.self_play)
    own = share(plan, 2)
    assert (own.learner.games, own.learner.batch, own.stage.env_steps) == (32, 8, 3 * CHUNK // 2)
    assert own.learner.steps_per_iteration == plan.learner.steps_per_iteration
    assert own.learner.updates_per_iteration == plan.learner.updates_per_iteration
    assert own.learner.rows == plan.learner.rows


@pytest.mark.parametrize(
    ("plan", "devices", "complaint"),
    [
        (Plan(DQN, SelfPlayConfig()), 3, "games = 64 .* a multiple of 3 devices"),
        (Plan(DQN, SelfPlayConfig(opponents=replace(PAST, seats=8))), 4, "games = 64 .* more"),
    ],
)
def test_what_cannot_be_shared_is_refused(plan, devices, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        share(plan, devices)
