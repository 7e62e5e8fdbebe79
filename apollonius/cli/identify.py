"""`apollonius identify`: a robot's limits, delays and noise from a recorded drive, as a table and
as a drive's file.
"""

import argparse
from collections.abc import Mapping
from dataclasses import asdict
from math import ceil, floor, inf, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.cli.options import add_json, print_next_step, print_result, shell_command
from apollonius.cli.terminal import columns
from apollonius.cli.values import bag_folder, new_file, player_or_file
from apollonius.io.errors import format_value, require, require_extra

if TYPE_CHECKING:
    from apollonius.simulate.identification import Estimate, Identification

STEP = 0.1
"""Of the game for which whole steps of delay are counted [s]; a drive's file holds one at most."""
_DIGITS = 3
"""Significant digits of limits and noise."""


def add_identify(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--bag",
        type=bag_folder,
        required=True,
        metavar="FOLDER",
        help="folder of a ROS 2 bag in which a robot drove",
    )
    parser.add_argument(
        "--odometry",
        type=player_or_file,
        default="odom",
        metavar="TOPIC",
        help="its odometry, the topic's whole name or the end of it (default: %(default)s)",
    )
    parser.add_argument(
        "--commands",
        type=player_or_file,
        default="cmd_vel",
        metavar="TOPIC",
        help="its commands, Twist or TwistStamped (default: %(default)s)",
    )
    parser.add_argument(
        "--out",
        type=new_file(".toml"),
        metavar="FILE",
        help="write a drive's file, a new one, for simulate --drive (default: print it)",
    )
    add_json(parser)
    parser.set_defaults(run=run_identify, compiles=False)


def run_identify(options: argparse.Namespace) -> int:
    """Print what a recorded drive says of its robot."""
    out = options.out
    require(out is None or not out.exists(), "--out", out, "a new file; choose another name")
    require_extra("bag", "identify")
    from apollonius.io.document import write_atomically
    from apollonius.simulate.drive_record import load_drive_record
    from apollonius.simulate.identification import identify

    record = load_drive_record(options.bag, options.odometry, options.commands)
    options.display.begin_task("fitting the model of a drive")
    identified = identify(record)
    counts = f"{len(record.times):,} odometries, {len(record.command_times):,} commands"
    heading = f"{format_value(options.bag)}: {record.duration:.0f} s, {counts}"
    text = f"{heading}\n{_table(identified)}"
    file = drive_file(identified, options.bag)
    facts = {"bag": str(options.bag), "duration": record.duration} | _facts(identified)
    print_result(options, facts, text if out else f"{text}\n\n{file}".rstrip())
    if out:
        write_atomically(out, file.encode())
        players = ("shielded:pursuer", "shielded:evader")
        print_next_step(options, out, then=shell_command("simulate", *players, "--drive", out))
    return 0


def _facts(identified: "Identification") -> dict[str, Any]:
    """Return all estimates as JSON knows them, which has no infinity."""

    def facts_of(estimate: "Estimate") -> dict[str, Any]:
        return asdict(estimate) | ({"high": None} if estimate.high == inf else {})

    groups = {"drive": identified.drive, "noise": identified.noise}
    return {
        group: {name: facts_of(estimate) for name, estimate in estimates.items()}
        for group, estimates in groups.items()
    }


def _table(identified: "Identification") -> str:
    """Return a row for each number, and what to record for those that have none."""
    noise = {f"noise of {name}": estimate for name, estimate in identified.noise.items()}
    rows = [("", "estimate", "95 % interval", "")]
    remedies: dict[str, list[str]] = {}
    for name, estimate in (identified.drive | noise).items():
        label = f"  {name.replace('turn_', 'turn ')}"
        if estimate.value is None:
            interval = f"at least {_number(estimate.low)}" if estimate.low else "-"
            rows.append((label, "not identified", interval, estimate.unit))
            remedies.setdefault(estimate.remedy, []).append(label.strip())
        else:
            interval = f"{_number(estimate.low)} to {_number(estimate.high)}"
            rows.append((label, _number(estimate.value), interval, estimate.unit))
    lines = [f"to identify {', '.join(names)}: {text}" for text, names in remedies.items()]
    return "\n".join([*map(str.rstrip, columns(rows)), *lines])


def _number(value: float) -> str:
    """Format a number with three significant digits, or fewer where those are below 0.0001."""
    return f"{value:.{_decimals(value)}f}"


def _decimals(value: float) -> int:
    """Return the decimals that give a number its significant digits, from 0 to 4."""
    size = floor(log10(value)) if value > 0 else 0
    return min(max(_DIGITS - 1 - size, 0), 4)


def _rounded_down(value: float) -> str:
    scale = 10 ** _decimals(value)
    return f"{floor(value * scale + 1e-9) / scale:.{_decimals(value)}f}"


def _rounded_up(value: float) -> str:
    scale = 10 ** _decimals(value)
    return f"{ceil(value * scale - 1e-9) / scale:.{_decimals(value)}f}"


def whole_steps(delay: float) -> int:
    """Return the steps that a delay [s] takes, the last one begun."""
    return ceil(delay / STEP - 1e-6)


def drive_file(identified: "Identification", bag: Path) -> str:
    """Return the text of a drive's file, with the lines for a game's file as comments."""
    lines = [
        f"# The drive in {format_value(bag)}, as apollonius identify measured it.",
        "# Masses and measures are the usual robot's: add yours (docs/reference/game_files.md).",
        *_drive_lines(identified.drive),
        "",
        "# For the game's file, limits rounded down and delays up, from the ends of the intervals:",
        *(f"# {line}".rstrip() for line in _game_lines(identified)),
    ]
    return "".join(f"{line}\n" for line in lines)


def _drive_lines(drive: Mapping[str, "Estimate"]) -> list[str]:
    lines: list[str] = []
    for name in ("latency", "lag", "turn_acceleration"):
        estimate = drive[name]
        if estimate.value is None:
            lines.append(f"# {name}: not identified; {estimate.remedy}")
            continue
        value = estimate.value
        about = f"{_number(estimate.low)} to {_number(estimate.high)} {estimate.unit}"
        if name == "latency" and value > STEP:
            value -= STEP * (whole_steps(value) - 1)
            about = f"of {_number(estimate.value)} s ({about}), without whole steps of {STEP} s"
        lines.append(f"{name} = {_toml(value)}  # {about}")
    return lines


def _toml(value: float) -> str:
    """Format a number as a float of TOML."""
    return f"{value:.{max(_decimals(value), 1)}f}"


def _game_lines(identified: "Identification") -> list[str]:
    """Return the tables of a game's file of a pursuer that is this robot."""
    drive = identified.drive
    lines = ["[pursuer]"]
    for name in ("v_max", "u1_max", "u2_max"):
        estimate = drive[name]
        is_identified = estimate.value is not None
        value = _rounded_down(estimate.low)
        lines.append(f"{name} = {value}" if is_identified else _unknown(name))
    return [*lines, "", *_delay_lines(drive), "", *_noise_lines(identified.noise)]


def _unknown(name: str) -> str:
    return f"{name}: not identified"


def _delay_lines(drive: Mapping[str, "Estimate"]) -> list[str]:
    latency, lag = drive["latency"], drive["lag"]
    lines = ["[drives.pursuer]"]
    if latency.value is None or lag.value is None:
        lines.append(_unknown("lag"))
    else:
        in_simulation = max(whole_steps(latency.value) - 1, 0)
        about = f"steps of {STEP} s; {in_simulation} with simulate --drive, which adds its own"
        lines.append(f"lag = {whole_steps(latency.high + lag.high)}  # {about}")
    turn, acceleration = drive["u2_max"], drive["turn_acceleration"]
    if turn.value is None or acceleration.value is None:
        lines.append(_unknown("turn_time"))
    else:
        lines.append(f"turn_time = {_rounded_up(turn.high / acceleration.low)}")
    return lines


def _noise_lines(noise: Mapping[str, "Estimate"]) -> list[str]:
    lines = ["[sensors.pursuer.own_noise]"]
    for name in ("position", "heading", "speed"):
        estimate = noise[name]
        is_identified = estimate.value is not None
        lines.append(f"{name} = {_rounded_up(estimate.high)}" if is_identified else _unknown(name))
    return lines
