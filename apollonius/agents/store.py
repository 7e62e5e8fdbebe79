"""Agents as files: weights in safetensors, and a JSON header that says what they were made for."""

import os
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np

from apollonius.agents.network import (
    MOST_LAYERS,
    MOST_WIDTH,
    Network,
    QNetwork,
    make_actor,
    make_network,
)
from apollonius.arenas.file import from_dict
from apollonius.game.types import NUM_ACTIONS, Role
from apollonius.game.validation import require_usual_numbers
from apollonius.io.arrays import named_leaves, open_arrays, read_header, read_tree, write_arrays
from apollonius.io.errors import InvalidInput, format_value, require, require_within
from apollonius.observe.egocentric import EGOCENTRIC
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.registry import OBSERVATIONS, has_observation

FORMAT = "apollonius-agent", 1
LARGEST = 10**9
"""Largest clearance margin [m] and value of a lost game."""
_MAKE = {"values": make_network, "gaussian": make_actor}
_ACTIONS = {"values": NUM_ACTIONS, "gaussian": 0}


@dataclass(frozen=True)
class AgentHeader:
    """Header of an agent's file."""

    role: str
    """The side it plays: `pursuer` or `evader`."""
    observation: str
    """Name of the observation its network reads."""
    observation_size: int
    """Numbers in that observation."""
    width: int
    """Units of each hidden layer."""
    depth: int
    """Number of hidden layers."""
    game: dict[str, Any] = field(default_factory=dict)
    """The game it was trained for, number by number."""
    training: dict[str, Any] = field(default_factory=dict)
    """Record of its training: command, seed, stage, env steps, episodes, evaluation."""
    num_actions: int = NUM_ACTIONS
    """Actions it chooses between; 0 where actions are pairs of levels."""
    network: str = "values"
    """Kind of its network: the `values` of the actions, or the `gaussian` of their levels."""
    symmetric: bool = False
    """True if the network treats left and right alike (`apollonius.agents.network.QNetwork`)."""
    clearance_margin: float = 0.0
    """Clearance after braking [m] that it keeps
    (`apollonius.agents.wrappers.clearance_penalty`); 0 for none."""
    loss_value: float | None = None
    """Value of a lost game in the network's units; None where it is the game's reward of a
    failure."""

    def __post_init__(self) -> None:
        require(self.role in ("pursuer", "evader"), "role", self.role, "pursuer or evader")
        require_within(self, 1, MOST_WIDTH, "width")
        require_within(self, 1, MOST_LAYERS, "depth")
        require_within(self, 0, LARGEST, "clearance_margin")
        require(
            self.loss_value is None or 0 < self.loss_value <= LARGEST,
            "loss_value",
            self.loss_value,
            f"above 0, at most {LARGEST:,}",
        )


@dataclass(frozen=True)
class Agent:
    """A trained network with its header."""

    network: Network
    header: AgentHeader


def describe(
    network: Network,
    role: Role,
    game: dict[str, Any],
    training: dict[str, Any],
    clearance_margin: float = 0.0,
    loss_value: float | None = None,
) -> Agent:
    """Return an agent with a header that fits its network.

    Args:
        network: the trained network.
        role: the side that it plays.
        game: the game of its training, as of `to_dict`.
        training: how it was trained.
        clearance_margin: clearance after braking that it keeps [m], or 0.
        loss_value: value of a lost game in the network's units, if that is not the game's reward of
            a failure.
    """
    is_q_network = isinstance(network, QNetwork)
    kind = "values" if is_q_network else "gaussian"
    width = network.layers[0].out_features
    header = AgentHeader(
        role=role.name.lower(),
        observation=network.observation.name,
        observation_size=network.observation.size,
        width=width if isinstance(width, int) else 1,
        depth=len(network.layers) - 1,
        game=game,
        training=training,
        num_actions=_ACTIONS[kind],
        network=kind,
        symmetric=is_q_network and network.symmetric,
        clearance_margin=clearance_margin,
        loss_value=loss_value,
    )
    return Agent(network, header)


def save_agent(agent: Agent, path: Path) -> None:
    """Write an agent's file, atomically."""
    arrays = {name: np.asarray(leaf) for name, leaf in named_leaves(agent.network).items()}
    write_arrays(path, arrays, agent.header, FORMAT)


def load_agent(path: Path) -> Agent:
    """Read an agent's file; raises InvalidInput for one that is missing, cut off, foreign, of a
    newer version, or made for an observation that this version does not have.
    """
    require_usual_numbers()
    with _read_agent(path) as (file, header):
        sizes = header.observation, header.width, header.depth
        template = eqx.filter_eval_shape(lambda: _MAKE[header.network](*sizes, jax.random.key(0)))
        if isinstance(template, QNetwork):
            template = replace(template, symmetric=header.symmetric)
        misfit = f"'{path}' has weights that do not fit its header: copy or train it again."
        if header.num_actions != _ACTIONS[header.network]:
            raise InvalidInput(misfit)
        return Agent(read_tree(path, file, template, misfit, "train it again"), header)


def load_header(path: Path) -> AgentHeader:
    """Read the header of an agent's file alone. Raises InvalidInput as `load_agent` does."""
    with _read_agent(path) as (_, header):
        return header


@contextmanager
def _read_agent(path: Path) -> Generator[tuple[Any, AgentHeader], None, None]:
    if not os.path.isfile(path):
        raise InvalidInput(
            f"there is no agent file '{path}': check the path, or name a built-in agent."
        )
    foreign = f"'{path}' holds no Apollonius agent: give a file from a run's agents/ folder"
    with open_arrays(path, "copy or train it again") as file:
        yield file, _check_agent(path, read_header(path, file, FORMAT, foreign))


def _check_agent(path: Path, fields: dict[str, Any]) -> AgentHeader:
    header = from_dict(AgentHeader, fields, f"the header of '{path}'")
    if header.network not in _MAKE:
        remedy = f"this program reads {', '.join(_MAKE)}: update it"
        raise InvalidInput(
            f"'{path}' has a network of the kind {format_value(header.network)}, {remedy}."
        )
    own_observation = None
    if has_observation(header.observation):
        own_observation = OBSERVATIONS[header.observation]
    if own_observation is None or own_observation.size != header.observation_size:
        sizes = ((name, observation.size) for name, observation in OBSERVATIONS.items())
        observations = ", ".join(f"{name} ({size})" for name, size in sizes)
        made_for = (
            f"{format_value(header.observation)} ({format_value(header.observation_size)} numbers)"
        )
        remedy = f"this program has {observations}: train it again"
        raise InvalidInput(f"'{path}' was made for the observation {made_for}; {remedy}.")
    mirrored = own_observation.mirror is not None and header.network == "values"
    require(
        mirrored or not header.symmetric,
        "symmetric",
        True,
        f"false where a network is of '{header.observation}'",
    )
    if header.clearance_margin > 0:
        _require_penalised(header, own_observation)
    return header


def _require_penalised(header: AgentHeader, observation: AbstractObservation) -> None:
    """Refuse a clearance margin of an agent whose values cannot have a penalty."""
    reads_braking = EGOCENTRIC.name in (observation.name, observation.extends)
    require(
        header.network == "values" and reads_braking,
        "clearance_margin",
        header.clearance_margin,
        f"0 where a network does not value actions, or reads '{observation.name}'",
    )
    require(
        header.loss_value is not None,
        "loss_value",
        "missing",
        "a number above 0 beside a clearance margin",
    )
