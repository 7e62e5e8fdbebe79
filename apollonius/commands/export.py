"""`apollonius export`: a trained agent as a file that needs no JAX."""

import argparse
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.commands.ending import command, finish
from apollonius.commands.values import named, new_file
from apollonius.errors import InvalidInput, require

if TYPE_CHECKING:
    from collections.abc import Callable

    from apollonius.adapters.export.blueprint import Blueprint
    from apollonius.adapters.export.parity import Decide
    from apollonius.agents.policy import AbstractPolicy
    from apollonius.evaluate.decisions import Decisions

FORMATS = ("onnx", "numpy", "c")
STATES = 10_000
"""Decisions of real games that an exported policy is compared on."""


def add_export(subparsers: Any) -> None:
    """The parser of `export`."""
    parser = subparsers.add_parser("export", help="write a trained agent as ONNX, NumPy or C, which need no JAX")
    parser.add_argument("agent", type=named, metavar="AGENT", help="a zoo agent, or a .safetensors file")
    parser.add_argument("--to", choices=FORMATS, required=True, help="ONNX, one Python file with NumPy, or C99")
    parser.add_argument(
        "--out",
        type=new_file(".onnx", ".py", ".c"),
        required=True,
        help="file to write: .onnx, .py or .c (with its .h)",
    )
    parser.add_argument(
        "--game",
        type=named,
        help="game that is built in: its name or .toml file (default: the one the agent was made for)",
    )
    parser.set_defaults(run=run_export)


def run_export(options: argparse.Namespace) -> int:
    """Write the file and check it."""
    from importlib import import_module

    from apollonius.adapters.export.blueprint import make_blueprint
    from apollonius.agents.catalogue import BUILT_IN, CLASSICAL, SHIELDED, find_trained
    from apollonius.agents.trained import at_best
    from apollonius.arenas.file import find_game
    from apollonius.arenas.record import from_dict
    from apollonius.document import write_atomically
    from apollonius.game.game import Game

    name: str = options.agent
    if name.startswith(SHIELDED):
        raise InvalidInput(f"'{name}' cannot be exported, a shield holds by the rules alone: export its bare player.")
    require(
        name not in {*BUILT_IN, *CLASSICAL}, "AGENT", name, "a trained agent: one of the zoo, or a .safetensors file"
    )
    try:
        format_ = import_module(f"apollonius.adapters.export.{options.to}")
    except ModuleNotFoundError as error:
        if error.name != "onnx":
            raise
        raise InvalidInput("writing ONNX needs a library: pip install 'apollonius[export]'.") from error
    out: Path = options.out
    require(out.suffix == format_.SUFFIX, "--out", out, f"a file that ends in {format_.SUFFIX} for --to {options.to}")
    agent, path = find_trained(name)
    require(
        options.game or agent.header.game, "--game", None, f"given, since '{name}' does not say what it was made for"
    )
    game = find_game(options.game) if options.game else from_dict(Game, agent.header.game, f"'{name}'")
    blueprint = make_blueprint(path.stem, agent, game)
    options.display.begin(f"writing the policy and comparing it in {STATES:,} states", compiles=True)
    with tempfile.TemporaryDirectory() as folder:
        files = format_.make_files(blueprint, Path(folder) / out.name)
        for file, content in files.items():
            file.write_bytes(content)
        checked = _check(blueprint, at_best(agent.network), lambda: format_.load(Path(folder) / out.name))
    out.parent.mkdir(parents=True, exist_ok=True)
    for file, content in files.items():
        write_atomically(out.with_name(file.name), content)
    options.display.end()
    print(blueprint.title, *checked, sep="\n")
    sides = (name, "random") if agent.header.role == "pursuer" else ("random", name)
    finish(
        *(out.with_name(file.name) for file in files),
        then=f"see what becomes of it on a robot with a body: {command('simulate', *sides, '--games', 300)}",
    )
    return 0


def _check(blueprint: "Blueprint", player: "AbstractPolicy", load: "Callable[[], Decide]") -> list[str]:
    """Lines that say whether the exported policy decides as the package's player, and how quickly.

    Raises:
        InvalidInput: if it does not.
    """
    import numpy as np

    from apollonius.adapters.export.parity import CannotRun, microseconds
    from apollonius.evaluate.decisions import decisions
    from apollonius.game.types import Role

    try:
        decide = load()
    except CannotRun as reason:
        return [f"not checked: {reason}"]
    played = decisions(blueprint.game, player, Role[blueprint.header.role.upper()], STATES)
    equal = (_same_controls if blueprint.continuous else _same_actions)(decide, blueprint, played)
    lines = [f"checked in {STATES:,} states of games: {equal}"]
    deciders: dict[str, Callable[[np.ndarray], object]] = {"this file": decide}
    states = {"this file": played.states}
    try:
        from apollonius.adapters.export.onnx import load_network

        deciders["network"], states["network"] = load_network(blueprint), played.observations
        beside = ""
    except (ModuleNotFoundError, CannotRun):
        beside = "; onnxruntime is not installed to compare with: pip install 'apollonius[export]'"
    times = {name: float(np.median(taken)) for name, taken in microseconds(deciders, states).items()}
    if "network" in times:
        beside = f"; onnxruntime, the network alone: {times['network']:.1f} us"
    return [*lines, f"one decision, median of 10,000: {times['this file']:.1f} us{beside}"]


def _same_actions(decide: "Decide", blueprint: "Blueprint", played: "Decisions") -> str:
    """How the actions of a discrete policy differ from the package's: in ties at most, or `InvalidInput` is raised."""
    from apollonius.adapters.export.parity import compare

    parity = compare(decide, blueprint, played.states, played.observations, played.actions)
    if parity.errors:
        raise InvalidInput(
            f"{parity.errors:,} of {STATES:,} actions differ from the package's: report this as an error."
        )
    ties = f", {parity.ties} of them equal in value to rounding" if parity.ties else ""
    return f"{parity.ties} actions differ from the package's{ties}"


def _same_controls(decide: "Decide", blueprint: "Blueprint", played: "Decisions") -> str:
    """How the controls of a continuous policy differ from the package's: by rounding, or `InvalidInput` is raised."""
    from apollonius.adapters.export.parity import TOLERANCE, largest_difference

    away = largest_difference(decide, blueprint, played.states, played.actions)
    if not away <= TOLERANCE:  # also where it is NaN
        raise InvalidInput(
            f"controls differ from the package's by {away:.0e} of the largest, more than {TOLERANCE:.0e}: "
            "report this as an error."
        )
    return f"controls differ from the package's by at most {away:.0e} of the largest"
