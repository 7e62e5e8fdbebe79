"""Agents as files: the same bits come back, and no other file passes for one."""

import json
import os

import jax
import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from apollonius.agents.network import make_actor, make_network
from apollonius.agents.store import describe, load_agent, save_agent
from apollonius.arenas.record import to_dict
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.io.document import write_atomically
from apollonius.io.errors import InvalidInput

GAME = to_dict(make_game("paper"))
TRAINING = {"command": "apollonius train", "seed": 3, "env_steps": 1000}


@pytest.fixture(scope="module")
def agent():
    return describe(make_network("paper", 4, 2, jax.random.key(0)), Role.EVADER, GAME, TRAINING)


@pytest.fixture
def path(agent, tmp_path):
    path = tmp_path / "agent.safetensors"
    save_agent(agent, path)
    return path


def refusal(path):
    """The one line with which a file is refused."""
    with pytest.raises(InvalidInput) as refused:
        load_agent(path)
    message = str(refused.value)
    assert "\n" not in message
    assert str(path) in message
    return message


def rewrite(path, **changes):
    """The same weights under another header; a field changed to None is left out."""
    with safe_open(path, framework="numpy") as file:
        metadata = file.metadata()
    header = json.loads(metadata["header"]) | changes
    header = {name: value for name, value in header.items() if value is not None}
    save_file(load_file(path), path, metadata | {"header": json.dumps(header)})


@pytest.mark.parametrize(
    ("make", "observation", "about"),
    [
        (make_network, "paper", ("values", 9, 2)),
        (make_network, "encoded", ("values", 9, 2)),
        (make_actor, "encoded", ("gaussian", 0, 2)),
    ],
)
def test_an_agent_comes_back_to_the_last_bit(make, observation, about, tmp_path):
    agent = describe(make(observation, 4, 2, jax.random.key(1)), Role.PURSUER, GAME, TRAINING)
    save_agent(agent, tmp_path / "agent.safetensors")
    loaded = load_agent(tmp_path / "agent.safetensors")
    assert loaded.header == agent.header
    assert (loaded.header.network, loaded.header.num_actions, loaded.header.depth) == about
    assert jax.tree.structure(loaded.network) == jax.tree.structure(agent.network)
    for ours, theirs in zip(jax.tree.leaves(agent.network), jax.tree.leaves(loaded.network), strict=True):
        assert ours.dtype == theirs.dtype
        np.testing.assert_array_equal(ours, theirs)


def cut(kept):
    return lambda path: path.write_bytes(path.read_bytes()[:kept])


def holding(metadata):
    return lambda path: save_file({"weight": np.zeros((3, 3), np.float32)}, path, metadata)


def told(**changes):
    return lambda path: rewrite(path, **changes)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda path: path.unlink(), "there is no agent file"),
        (lambda path: (path.unlink(), path.mkdir()), "there is no agent file"),
        (cut(300), "not a whole safetensors file"),
        *((holding(data), "no Apollonius agent") for data in (None, {"format": "pt"})),
        (told(observation="lidar"), "observation lidar (8 numbers); this program has paper (8), encoded (17)"),
        (told(observation_size=10), "observation paper (10 numbers)"),
        *((told(**changes), "do not fit its header") for changes in ({"width": 7}, {"depth": 3}, {"depth": 1})),
        *((told(version=version), f"version {version}") for version in (2, 0, "1")),
        (told(network="gaussian"), "do not fit"),
        (told(network="sideways"), "of the kind sideways"),
    ],
)
def test_what_is_no_agent_of_this_program_is_refused(path, spoil, said):
    spoil(path)
    assert said in refusal(path)


def test_a_write_is_on_disk_before_it_takes_the_old_ones_place(tmp_path, monkeypatch):
    path = tmp_path / "file"
    path.write_bytes(b"old")
    calls = []
    fsync, rename = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda number: (calls.append("fsync"), fsync(number)))
    monkeypatch.setattr(
        os, "replace", lambda source, target: (calls.append(f"replace {path.read_text()}"), rename(source, target))
    )
    write_atomically(path, b"new")
    assert calls == ["fsync", "replace old"]
    assert path.read_bytes() == b"new"
