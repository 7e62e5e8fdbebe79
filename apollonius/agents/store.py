"""Agents as files: weights in safetensors, and a JSON header that says what they were made for."""

import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from apollonius.agents.network import Network, QNetwork, make_actor, make_network
from apollonius.errors import InvalidInput
from apollonius.game.observation import OBSERVATION_SIZES
from apollonius.game.types import NUM_ACTIONS, Role

FORMAT = "apollonius-agent"
FORMAT_VERSION = 1
_MAKE = {"values": make_network, "gaussian": make_actor}


@dataclass(frozen=True)
class AgentHeader:
    """What an agent's file says about it."""

    role: str
    """The side it plays: `pursuer` or `evader`."""
    observation: str
    """Profile of the observation its network reads."""
    observation_size: int
    """Numbers in that observation."""
    width: int
    """Units of each hidden layer."""
    depth: int
    """Number of hidden layers."""
    game: dict[str, Any] = field(default_factory=dict)
    """The game it was trained for, number by number."""
    training: dict[str, Any] = field(default_factory=dict)
    """How it was trained: command, seed, stage, env steps, episodes, evaluation."""
    num_actions: int = NUM_ACTIONS
    """Actions it chooses between; 0 of one whose actions are pairs of gears."""
    network: str = "values"
    """What its network says: the `values` of the actions, or the `gaussian` of the gears."""
    format: str = FORMAT
    version: int = FORMAT_VERSION


@dataclass(frozen=True)
class Agent:
    """A trained network with its header."""

    network: Network
    header: AgentHeader


def describe(network: Network, role: Role, game: dict[str, Any], training: dict[str, Any]) -> Agent:
    """An agent from a network, with a header that fits it."""
    header = AgentHeader(
        role=role.name.lower(),
        observation=network.observation,
        observation_size=OBSERVATION_SIZES[network.observation],
        width=network.layers[0].out_features if isinstance(network.layers[0].out_features, int) else 1,
        depth=len(network.layers) - 1,
        game=game,
        training=training,
        num_actions=NUM_ACTIONS if isinstance(network, QNetwork) else 0,
        network="values" if isinstance(network, QNetwork) else "gaussian",
    )
    return Agent(network, header)


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file so that at every moment either the old or the new content is there, whole.

    Raises:
        OSError: when the disk is full or read-only; the old content is untouched.
    """
    temporary = path.with_name(path.name + ".tmp")
    try:
        with open(temporary, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise


def save_agent(agent: Agent, path: Path) -> None:
    """Write an agent's file, atomically.

    Raises:
        OSError: when the file cannot be written.
    """
    arrays = {name: np.asarray(leaf) for name, leaf in named_leaves(agent.network).items()}
    # One entry: safetensors writes several in an order of their own, and one seed must give one file.
    write_atomically(path, save(arrays, {"header": json.dumps(asdict(agent.header), sort_keys=True)}))


def load_agent(path: Path) -> Agent:
    """Read an agent's file.

    Raises:
        InvalidInput: for a file that is missing, truncated, not an agent's, of a newer version, or made for an
            observation this version does not have; says which, and what to do.
    """
    if not path.is_file():
        raise InvalidInput(f"there is no agent file '{path}': check the path, or name a built-in agent.")
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = file.metadata() or {}
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    except (SafetensorError, OSError) as error:
        raise InvalidInput(f"'{path}' is not a whole safetensors file ({error}): copy or train it again.") from error
    header = _read_header(path, metadata)
    make = _MAKE[header.network]
    template = eqx.filter_eval_shape(lambda: make(header.observation, header.width, header.depth, jax.random.key(0)))
    return Agent(_fill(path, template, arrays), header)


def _read_header(path: Path, metadata: dict[str, str]) -> AgentHeader:
    foreign = f"'{path}' holds no Apollonius agent: give a file from a run's agents/ folder."
    try:
        fields = json.loads(metadata["header"])
        if fields.get("format") != FORMAT:
            raise InvalidInput(foreign)
        version = fields.get("version")
        if version != FORMAT_VERSION:
            raise InvalidInput(
                f"'{path}' has format version {version}, this program reads {FORMAT_VERSION}: update it."
            )
        header = AgentHeader(**fields)
    except (KeyError, TypeError, AttributeError, json.JSONDecodeError) as error:
        raise InvalidInput(foreign) from error
    if header.network not in _MAKE:
        raise InvalidInput(
            f"'{path}' has a network of the kind {header.network}, this program reads {', '.join(_MAKE)}: update it."
        )
    size = OBSERVATION_SIZES.get(header.observation)
    if size != header.observation_size:
        known = ", ".join(f"{name} ({size})" for name, size in OBSERVATION_SIZES.items())
        raise InvalidInput(
            f"'{path}' was made for the observation {header.observation} ({header.observation_size} numbers); "
            f"this program has {known}: train it again."
        )
    return header


def _fill(path: Path, template: Network, arrays: dict[str, np.ndarray]) -> Network:
    expected = named_leaves(template)
    if kinds_of(arrays) != kinds_of(expected):
        raise InvalidInput(f"'{path}' has weights that do not fit its header: copy or train it again.")
    leaves = jax.device_put([arrays[name] for name in expected])
    return jax.tree.unflatten(jax.tree.structure(template), leaves)


def kinds_of(arrays: dict[str, Any]) -> dict[str, tuple[tuple[int, ...], Any]]:
    """Shape and number type of every named array: what two files of one structure have in common."""
    return {name: (array.shape, array.dtype) for name, array in arrays.items()}


def named_leaves(tree: Any) -> dict[str, Any]:
    """The arrays of a pytree by their paths, as `layers/0/weight`, in the tree's own order."""
    leaves = jax.tree_util.tree_flatten_with_path(tree)[0]
    return {jax.tree_util.keystr(path, simple=True, separator="/"): leaf for path, leaf in leaves}
