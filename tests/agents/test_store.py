"""Agents as files: the same bits come back, and no other file passes for one."""

import errno
import json
import os
from dataclasses import asdict, replace

import jax
import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from apollonius.agents.network import make_actor, make_network
from apollonius.agents.store import AgentHeader, describe, load_agent, save_agent
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


@pytest.mark.parametrize("observation", ["paper", "encoded"])
def test_an_agent_comes_back_to_the_last_bit(observation, tmp_path):
    agent = describe(make_network(observation, 4, 2, jax.random.key(1)), Role.PURSUER, GAME, TRAINING)
    save_agent(agent, tmp_path / "agent.safetensors")
    loaded = load_agent(tmp_path / "agent.safetensors")
    assert loaded.header == agent.header
    assert jax.tree.structure(loaded.network) == jax.tree.structure(agent.network)
    for ours, theirs in zip(jax.tree.leaves(agent.network), jax.tree.leaves(loaded.network), strict=True):
        assert ours.dtype == theirs.dtype
        np.testing.assert_array_equal(ours, theirs)


def test_one_agent_is_one_file_to_the_last_byte(agent, path, tmp_path):
    """However often it is saved."""
    for attempt in range(20):
        again = tmp_path / f"{attempt}.safetensors"
        save_agent(agent, again)
        assert again.read_bytes() == path.read_bytes()


def test_the_header_says_what_the_agent_was_made_for(agent):
    assert asdict(agent.header) == {
        "format": "apollonius-agent",
        "version": 1,
        "role": "evader",
        "observation": "paper",
        "observation_size": 8,
        "num_actions": 9,
        "network": "values",
        "width": 4,
        "depth": 2,
        "game": GAME,
        "training": TRAINING,
    }


def test_the_header_is_plain_json_in_the_file(agent, path):
    with safe_open(path, framework="numpy") as file:
        assert AgentHeader(**json.loads(file.metadata()["header"])) == agent.header


def test_a_missing_file_is_refused(tmp_path):
    assert "there is no agent file" in refusal(tmp_path / "nobody.safetensors")


def test_a_folder_is_refused(tmp_path):
    assert "there is no agent file" in refusal(tmp_path)


@pytest.mark.parametrize("kept", [0, 1, 7, 8, 9, 300, -500, -1])
def test_a_truncated_file_is_refused(path, kept):
    """Cut within the length, the header and the weights."""
    path.write_bytes(path.read_bytes()[:kept])
    assert "not a whole safetensors file" in refusal(path)


def test_a_text_file_is_refused(tmp_path):
    path = tmp_path / "notes.safetensors"
    path.write_text("These are not the weights you are looking for.\n" * 20)
    assert "not a whole safetensors file" in refusal(path)


@pytest.mark.parametrize("metadata", [None, {"format": "pt"}, {"format": "apollonius-checkpoint-1"}])
def test_weights_of_something_else_are_refused(tmp_path, metadata):
    path = tmp_path / "other.safetensors"
    save_file({"weight": np.zeros((3, 3), np.float32)}, path, metadata)
    assert "no Apollonius agent" in refusal(path)


@pytest.mark.parametrize(("observation", "size"), [("lidar", 8), ("paper", 10), ("encoded", 16)])
def test_an_agent_made_for_another_observation_is_refused(path, observation, size):
    rewrite(path, observation=observation, observation_size=size)
    message = refusal(path)
    assert f"{observation} ({size} numbers)" in message
    assert "paper (8), encoded (17)" in message


def test_weights_that_do_not_fit_the_observation_are_refused(path):
    rewrite(path, observation="encoded", observation_size=17)
    assert "do not fit its header" in refusal(path)


@pytest.mark.parametrize("changes", [{"width": 7}, {"depth": 3}, {"depth": 1}])
def test_weights_of_another_shape_are_refused(path, changes):
    rewrite(path, **changes)
    assert "do not fit its header" in refusal(path)


def test_weights_of_another_number_type_are_refused(path):
    with safe_open(path, framework="numpy") as file:
        metadata = file.metadata()
    save_file({name: weights.astype(np.float16) for name, weights in load_file(path).items()}, path, metadata)
    assert "do not fit its header" in refusal(path)


@pytest.mark.parametrize("version", [2, 0, "1"])
def test_another_format_version_is_refused(path, version):
    rewrite(path, version=version)
    assert f"version {version}" in refusal(path)


@pytest.mark.parametrize(
    "changes", [{"role": None}, {"colour": "red"}, {"width": "wide"}, {"depth": -1}, {"observation": ["paper"]}]
)
def test_a_malformed_header_is_refused(path, changes):
    rewrite(path, **changes)
    refusal(path)


def fail_with_a_full_disk(*arguments):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_failed_write_leaves_the_old_agent(agent, path, monkeypatch, call):
    before = path.read_bytes()
    monkeypatch.setattr(os, call, fail_with_a_full_disk)
    other = replace(agent, header=replace(agent.header, role="pursuer"))
    with pytest.raises(OSError, match="No space left"):
        save_agent(other, path)
    assert path.read_bytes() == before
    assert [file.name for file in path.parent.iterdir()] == [path.name]


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


def test_an_agent_with_continuous_actions_comes_back_as_one(tmp_path):
    actor = make_actor("encoded", 4, 2, jax.random.key(1))
    save_agent(describe(actor, Role.EVADER, GAME, TRAINING), tmp_path / "actor.safetensors")
    loaded = load_agent(tmp_path / "actor.safetensors")
    assert (loaded.header.network, loaded.header.num_actions, loaded.header.depth) == ("gaussian", 0, 2)
    assert jax.tree.structure(loaded.network) == jax.tree.structure(actor)
    for ours, theirs in zip(jax.tree.leaves(actor), jax.tree.leaves(loaded.network), strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize(("network", "said"), [("gaussian", "do not fit"), ("sideways", "of the kind sideways")])
def test_a_network_of_another_kind_than_the_header_says_is_refused(path, network, said):
    rewrite(path, network=network)
    assert said in refusal(path)
