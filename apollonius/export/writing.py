"""A player written in another language, checked against the package's own before it is kept."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from apollonius.agents.names import SHIELDED
from apollonius.arenas.file import to_dict
from apollonius.export.parity import Decide, cases_of, compare_decisions, microseconds
from apollonius.export.player import LARGEST, Player
from apollonius.game.models import model_name
from apollonius.io.document import to_json, write_atomically
from apollonius.io.errors import InvalidInput, require, require_extra
from apollonius.io.record import write_record
from jaxpr2c.compiler import CompiledProgram, has_compiler
from jaxpr2c.errors import TranslationError
from jaxpr2c.program import Program
from jaxpr2c.record import Record
from jaxpr2c.translator import translate

ABOUT = ".robot.json"
"""Ending of the file that tells a robot's program about an exported player; `ros2/` has one that
reads it.
"""
STATES = 10_000
"""Decisions of real games that an exported player is compared on."""


Written = tuple[list[Path], list[str]]
"""The files of an exported player, and lines that describe it and the results of its check."""


@contextmanager
def refuse_untranslatable() -> Generator[None]:
    """Turn a refusal or a failure of the translator into InvalidInput."""
    try:
        yield
    except TranslationError as reason:
        raise InvalidInput(str(reason)) from reason


@refuse_untranslatable()
def write_c(player: Player, out: Path, constants: bool = False, states: int = STATES) -> Written:
    """Write a player as C99: a source, its header, and files of its data.

    Nothing is written unless the program decides as the package's player does.

    Args:
        player: The player.
        out: File of the source, with a name that is free in C and ends in `.c`; the other files are
            beside it.
        constants: Whether the player's numbers are in the source instead of a file.
        states: Number of states in which decisions are compared.

    Raises:
        InvalidInput: For another name, a player that cannot be translated, and one that decides
            otherwise in some of
            the states.
    """
    arguments = player.arguments[1:] if constants else player.arguments
    decide = partial(player.decide, player.policy) if constants else player.decide
    program = translate(decide, *arguments, name=out.stem)
    report_lines = _check(program, player, arguments[:-5], states)
    contents = {
        out: program.source().encode(),
        out.with_suffix(".h"): program.header(_about(program, player)).encode(),
    }
    for record, argument in zip(program.arguments, arguments, strict=False):
        if record.name in ("player", "game", "memory") and record.leaves:
            contents[out.with_suffix(f".{record.name}")] = record.pack(argument)
    contents[out.with_suffix(ABOUT)] = to_json(_facts(program, player, contents)).encode()
    for file, content in contents.items():
        write_atomically(file, content)
    return list(contents), [f"The {player.role.name.lower()} {player.name}", *report_lines]


def write_onnx(player: Player, out: Path) -> Written:
    """Write a player as an ONNX model, by jax2onnx over the function that plays. Nothing is written
    unless it decides as the package's player does; raises InvalidInput there, for a player behind a
    shield or that jax2onnx cannot take, and where the libraries are not installed.
    """
    bound = (
        "one without a shield: jax2onnx takes a remainder of known numbers for 0, and braking "
        "turns; C takes it"
    )
    require(not player.name.startswith(SHIELDED), "player", player.name, bound)
    require_extra("export", "writing ONNX")
    from apollonius.export.onnx import load, model_of

    model = model_of(player)
    decide, repeat_call = load(model)
    lines = check(decide, player, STATES)
    write_atomically(out, model)
    time_line = f"one decision in onnxruntime, median of 10,000: {microseconds(repeat_call):.1f} us"
    return [out], [f"The {player.role.name.lower()} {player.name}", *lines, time_line]


def _check(program: Program, player: Player, fixed: tuple[Any, ...], states: int) -> list[str]:
    """Check the program, whose first arguments are `fixed`, and time it; return lines that tell the
    results.
    """
    if not has_compiler():
        return ["not checked: there is no gcc here; install it, and export again"]
    compiled_program = CompiledProgram(program)

    def decide(
        state: np.ndarray, active: Any, movers: Any, memory: Any, bits: np.uint32
    ) -> tuple[np.ndarray, np.ndarray]:
        action, controls = compiled_program(*fixed, state, active, movers, memory, bits)[:2]
        return action, controls

    lines = check(decide, player, states)
    return [
        *lines,
        f"one decision, median of 10,000: {microseconds(compiled_program.rerun):.1f} us",
    ]


def check(decide: Decide, player: Player, states: int) -> list[str]:
    """Compare a player with the package's; return a line that tells the result. Raises
    InvalidInput for other decisions.
    """
    parity = compare_decisions(decide, player, cases_of(player, states))
    if parity.errors:
        raise InvalidInput(
            f"{parity.errors:,} of {states:,} decisions differ from the package's: "
            "report this as an error."
        )
    ties = f", {parity.ties} of them within rounding of another" if parity.ties else ""
    return [
        f"checked in {states:,} states of games: the package's decisions{ties}; "
        f"controls within {parity.away:.0e}"
    ]


def _facts(program: Program, player: Player, files: Mapping[Path, bytes]) -> dict[str, Any]:
    """Describe the function for its callers: its arguments, its results and the robot's limits.

    An argument that is a file's content has the file's SHA-256; one that is a number has its type.
    """
    game = player.game
    body, *mates = game.bodies[player.role]
    rules = to_dict(game)
    if game.arena.map is not None:  # without its folder, which is this machine's
        rules["arena"]["map"]["file"] = Path(game.arena.map.file).name
    digests = {file.suffix[1:]: sha256(content).hexdigest() for file, content in files.items()}

    def fact(record: Record) -> dict[str, Any]:
        number = record.leaves[0].kind if record.is_array and record.leaves[0].size == 1 else None
        digest = digests.get(record.name)
        return {
            "name": record.name,
            "bytes": record.layout.itemsize,
            "number": number,
            "sha256": digest,
        }

    return {
        "name": program.name,
        "player": player.name,
        "side": player.role.name.lower(),
        "mates": len(mates),
        "opponents": len(game.bodies[player.role.other]),
        "dt": float(game.dt),
        "max_steps": int(game.max_steps),
        "body": {"model": model_name(body)} | write_record(body, {}),
        "fastest": max(float(robot.top_speed) for side in game.bodies for robot in side),
        "u1_max": float(body.u1_max),
        "u2_max": float(body.u2_max),
        "arguments": [fact(record) for record in program.arguments if record.leaves],
        "results": [fact(record) for record in program.results if record.leaves],
        "game": rules,
    }


def _about(program: Program, player: Player) -> list[str]:
    game = player.game
    body = game.bodies[player.role][0]
    names = {record.name for record in program.records}
    files = " and ".join(
        f"{program.name}.{name}" for name in ("player", "game", "memory") if name in names
    )
    notes = {
        files: "the structs below as a little-endian machine has them: read them into memory"
    } | _argument_notes(player)
    speeds = f"v from {body.v_min:g} to {body.v_max:g} m/s"
    u2 = f"{body.second_control} within {body.u2_max:g}"
    limits = f"{speeds}, |u1| to {body.u1_max:g} m/s^2, {u2}"
    return [
        f"The {player.role.name.lower()} {player.name} of a pursuit-evasion game, {game.size}.",
        f"Its robot: {limits}, radius {body.radius:g} m.",
        "",
        *(
            f"{name}: {words}."
            for name, words in notes.items()
            if name in names or (files and name == files)
        ),
        "",
        f"A state with a NaN, an infinity or a number beyond {LARGEST:,.0f} gets full braking, "
        "straight ahead"
        + (", but for an opponent's or a mover's: that is not seen now." if game.sensors else "."),
        "Nothing is allocated, and nothing is kept between calls.",
    ]


def _argument_notes(player: Player) -> dict[str, str]:
    """Describe the arguments and results of a decision, by their names."""
    body, *mates = player.game.bodies[player.role]
    opponents = player.game.bodies[player.role.other]
    opponents_text = "its opponent's"
    if player.robots > 2:
        opponents_text = f"its {len(mates)} mates', then its {len(opponents)} opponents'"
    levels = "shares of the largest controls, in [-1, 1]"
    nine = "3 * (level of u1) + (level of u2), a level being 0, 1, 2 for -max, 0, +max"
    dt = player.game.dt
    return {
        "state": f"x [m], y [m], speed [m/s], heading [rad] of {player.robots} robots: its own, "
        f"then {opponents_text}",
        "active": "of the same robots, whether each is in play",
        "movers": f"x [m], y [m], velocity x, y [m/s] of {player.movers} movers: shuttles, doors, "
        "then walkers, in the order of the game's file",
        "memory": "where a game begins that of the file, later what the last call returned",
        "bits": "32 random bits, fresh for every call",
        "action": levels if player.policy.continuous else nine,
        "controls": f"acceleration u1 [m/s^2] and {body.second_control}, to be held for {dt:g} s",
    }
