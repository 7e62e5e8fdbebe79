"""Agents as files: weights in safetensors, and a JSON header that says what they were made for."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from apollonius.agents.network import MOST_LAYERS, MOST_WIDTH, Network, QNetwork, make_actor, make_network
from apollonius.document import parse_json
from apollonius.errors import InvalidInput, require, shown
from apollonius.game.observation import OBSERVATION_SIZES
from apollonius.game.record import from_dict
from apollonius.game.types import NUM_ACTIONS, Role

FORMAT = "apollonius-agent"
FORMAT_VERSION = 1
MOST_HEADER = 2**24
"""Largest header of a file [bytes]."""
_MAKE = {"values": make_network, "gaussian": make_actor}
_ACTIONS = {"values": NUM_ACTIONS, "gaussian": 0}
_NUMBERS = {
    name: np.dtype(kind)
    for name, kind in (
        ("BOOL", bool), ("U8", np.uint8), ("I8", np.int8), ("U16", np.uint16), ("I16", np.int16), ("F16", np.float16),
        ("U32", np.uint32), ("I32", np.int32), ("F32", np.float32),
    )
}  # fmt: skip
"""Number types by the names that safetensors has for them."""


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

    def __post_init__(self) -> None:
        require(self.role in ("pursuer", "evader"), "role", self.role, "pursuer or evader")
        require(1 <= self.width <= MOST_WIDTH, "width", self.width, f"from 1 to {MOST_WIDTH:,}")
        require(1 <= self.depth <= MOST_LAYERS, "depth", self.depth, f"from 1 to {MOST_LAYERS}")


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
    with opened(path, "copy or train it again") as file:
        header = _read_header(path, file.metadata() or {})
        template = eqx.filter_eval_shape(
            _MAKE[header.network], header.observation, header.width, header.depth, jax.random.key(0)
        )
        expected = named_leaves(template)
        misfit = f"'{path}' has weights that do not fit its header: copy or train it again."
        if kinds_in(file) != kinds_of(expected) or header.num_actions != _ACTIONS[header.network]:
            raise InvalidInput(misfit)
        arrays = {name: file.get_tensor(name) for name in expected}
    require_finite(path, arrays, "train it again")
    leaves = [jnp.asarray(array) for array in arrays.values()]
    return Agent(jax.tree.unflatten(jax.tree.structure(template), leaves), header)


def _read_header(path: Path, metadata: dict[str, str]) -> AgentHeader:
    foreign = f"'{path}' holds no Apollonius agent: give a file from a run's agents/ folder"
    fields = parse_json(metadata.get("header", ""), foreign)
    if fields.get("format") != FORMAT:
        raise InvalidInput(f"{foreign}.")
    version = fields.get("version")
    if version != FORMAT_VERSION:
        told = f"'{path}' has format version {shown(version)}, this program reads {FORMAT_VERSION}: update it."
        raise InvalidInput(told)
    header = from_dict(AgentHeader, fields, f"the header of '{path}'")
    if header.network not in _MAKE:
        raise InvalidInput(
            f"'{path}' has a network of the kind {shown(header.network)}, this program reads {', '.join(_MAKE)}: "
            "update it."
        )
    size = OBSERVATION_SIZES.get(header.observation)
    if size != header.observation_size:
        known = ", ".join(f"{name} ({size})" for name, size in OBSERVATION_SIZES.items())
        made_for = f"{shown(header.observation)} ({shown(header.observation_size)} numbers)"
        raise InvalidInput(
            f"'{path}' was made for the observation {made_for}; this program has {known}: train it again."
        )
    return header


@contextmanager
def opened(path: Path, remedy: str, kind: str = "safetensors file") -> Iterator[Any]:
    """A safetensors file of which nothing but the header is read yet.

    Args:
        remedy: what to do about a damaged file.
        kind: what it should be.

    Raises:
        InvalidInput: when it is none, is cut off, or has a header of more than `MOST_HEADER` bytes.
    """
    damaged = f"'{path}' is not a whole {kind}"
    try:
        with open(path, "rb") as file:
            size = int.from_bytes(file.read(8), "little")
        if size > MOST_HEADER:
            raise InvalidInput(f"{damaged} (a header of {size:,} bytes): {remedy}.")
        with safe_open(path, framework="numpy") as file:
            yield file
    except (SafetensorError, OSError) as error:
        raise InvalidInput(f"{damaged} ({error}): {remedy}.") from error


def kinds_in(file: Any) -> dict[str, tuple[tuple[int, ...], Any]]:
    """Shape and number type of every array of an open safetensors file, by its header alone; as `kinds_of`."""
    slices = {name: file.get_slice(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    return {name: (tuple(one.get_shape()), _NUMBERS.get(one.get_dtype())) for name, one in slices.items()}


def require_finite(path: Path, arrays: dict[str, np.ndarray], remedy: str) -> None:
    """Refuse a file whose numbers are not all finite.

    Raises:
        InvalidInput: with the name of the first array that has one that is not.
    """
    for name, array in arrays.items():
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise InvalidInput(f"'{path}' has numbers that are not finite, in {name}: {remedy}.")


def kinds_of(arrays: dict[str, Any]) -> dict[str, tuple[tuple[int, ...], Any]]:
    """Shape and number type of every named array: what two files of one structure have in common."""
    return {name: (array.shape, array.dtype) for name, array in arrays.items()}


def named_leaves(tree: Any) -> dict[str, Any]:
    """The arrays of a pytree by their paths, as `layers/0/weight`, in the tree's own order."""
    leaves = jax.tree_util.tree_flatten_with_path(tree)[0]
    return {jax.tree_util.keystr(path, simple=True, separator="/"): leaf for path, leaf in leaves}
