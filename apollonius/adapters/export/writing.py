"""Trained agents written in another format, each checked against the package's own player before it is kept."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from apollonius.adapters.export.blueprint import Blueprint, make_blueprint
from apollonius.adapters.export.parity import TOLERANCE, CannotRun, Decide, compare, largest_difference, microseconds
from apollonius.agents.built_in import PLAYERS
from apollonius.agents.store import Agent
from apollonius.agents.trained import find_trained, greedy
from apollonius.arenas.charting import charted
from apollonius.arenas.record import from_dict
from apollonius.catalogue import SHIELDED
from apollonius.document import write_atomically
from apollonius.errors import InvalidInput, install, require
from apollonius.evaluate.decisions import Decisions, decisions
from apollonius.game.game import Game
from apollonius.game.types import Role

STATES = 10_000
"""Decisions of real games that an exported policy is compared on."""


@runtime_checkable
class Format(Protocol):
    """A module of this folder: a kind of file that needs no JAX."""

    SUFFIX: str
    """How the names of its files end."""

    def make_files(self, blueprint: Blueprint, out: Path) -> dict[Path, bytes]:
        """The files of a policy, by where they lie."""
        ...

    def load(self, path: Path) -> Decide:
        """The policy of a file that was written."""
        ...


@dataclass(frozen=True)
class Written:
    """A policy that was written: its files, what it is, and what checking it came to, a line each."""

    files: tuple[Path, ...]
    about: tuple[str, ...]


def find_format(name: str) -> Format:
    """The format of this name.

    Raises:
        InvalidInput: where the library that it takes is not installed.
    """
    try:
        return import_module(f"apollonius.adapters.export.{name}")  # pyright: ignore[reportReturnType]
    except ModuleNotFoundError as error:
        if error.name != "onnx":
            raise
        raise InvalidInput(f"writing ONNX needs a library: {install('export')}.") from error


def find_exportable(name: str) -> tuple[Agent, Path]:
    """The agent of this name and its file.

    Raises:
        InvalidInput: where it is no trained agent, or none alone.
    """
    if name.startswith(SHIELDED):
        raise InvalidInput(f"'{name}' cannot be exported, a shield holds by the rules alone: export its bare player.")
    require(name not in PLAYERS, "agent", name, "a trained agent: one of the zoo, or a .safetensors file")
    return find_trained(name)


def game_of(agent: Agent, name: str) -> Game:
    """The game that an agent was made for.

    Raises:
        InvalidInput: where its file does not say it.
    """
    require(agent.header.game, "game", None, f"given, since '{name}' does not say what it was made for")
    return from_dict(Game, agent.header.game, f"'{name}'")


def write_policy(agent: Agent, name: str, game: Game, format_: Format, out: Path) -> Written:
    """Write an agent for a game. Nothing is written unless it decides as the package's player does.

    Args:
        name: what the policy is called.
        out: the file; some formats write others beside it.

    Raises:
        InvalidInput: for an agent or a game that cannot be exported, and where it decides otherwise.
    """
    blueprint = make_blueprint(name, agent, game)
    with tempfile.TemporaryDirectory() as folder:
        files = format_.make_files(blueprint, Path(folder) / out.name)
        for file, content in files.items():
            file.write_bytes(content)
        checked = _check(blueprint, agent, lambda: format_.load(Path(folder) / out.name))
    written = {out.with_name(file.name): content for file, content in files.items()}
    for file, content in written.items():
        write_atomically(file, content)
    return Written(tuple(written), (blueprint.title, *checked))


def _check(blueprint: Blueprint, agent: Agent, load: Callable[[], Decide]) -> list[str]:
    """Lines that say whether the exported policy decides as the package's player, and how quickly.

    Raises:
        InvalidInput: if it does not.
    """
    try:
        decide = load()
    except CannotRun as reason:
        return [f"not checked: {reason}"]
    game = charted(blueprint.game) if blueprint.charted else blueprint.game
    played = decisions(game, greedy(agent.network), Role[blueprint.header.role.upper()], STATES)
    equal = (_same_controls if blueprint.continuous else _same_actions)(decide, blueprint, played)
    lines = [f"checked in {STATES:,} states of games: {equal}"]
    deciders: dict[str, Callable[[np.ndarray], object]] = {"this file": decide}
    states = {"this file": played.states}
    try:
        from apollonius.adapters.export.onnx import load_network

        deciders["network"], states["network"] = load_network(blueprint), played.observations
        beside = ""
    except (ModuleNotFoundError, CannotRun):
        beside = f"; onnxruntime is not installed to compare with: {install('export')}"
    times = {name: float(np.median(taken)) for name, taken in microseconds(deciders, states).items()}
    if "network" in times:
        beside = f"; onnxruntime, the network alone: {times['network']:.1f} us"
    return [*lines, f"one decision, median of 10,000: {times['this file']:.1f} us{beside}"]


def _same_actions(decide: Decide, blueprint: Blueprint, played: Decisions) -> str:
    """How the actions of a discrete policy differ from the package's: in ties at most, or `InvalidInput` is raised."""
    parity = compare(decide, blueprint, played.states, played.observations, played.actions)
    if parity.errors:
        raise InvalidInput(
            f"{parity.errors:,} of {STATES:,} actions differ from the package's: report this as an error."
        )
    ties = f", {parity.ties} of them equal in value to rounding" if parity.ties else ""
    jumps = f", {parity.jumps} of them where what is seen of the chart jumps" if parity.jumps else ""
    return f"{parity.ties + parity.jumps} actions differ from the package's{ties}{jumps}"


def _same_controls(decide: Decide, blueprint: Blueprint, played: Decisions) -> str:
    """How the controls of a continuous policy differ from the package's: by rounding, or `InvalidInput` is raised."""
    away = largest_difference(decide, blueprint, played.states, played.actions)
    if not away <= TOLERANCE:  # also where it is NaN
        raise InvalidInput(
            f"controls differ from the package's by {away:.0e} of the largest, more than {TOLERANCE:.0e}: "
            "report this as an error."
        )
    return f"controls differ from the package's by at most {away:.0e} of the largest"
