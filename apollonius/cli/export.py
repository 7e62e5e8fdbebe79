"""`apollonius export` and `replay`: a player as C or ONNX, which need no JAX, and what a robot
recorded of one.
"""

import argparse
from pathlib import Path

from apollonius.agents.names import SIDES
from apollonius.cli.options import add_json, print_next_step, print_result, warn
from apollonius.cli.terminal import columns
from apollonius.cli.values import existing_agent, existing_game, new_file, player_or_file
from apollonius.io.errors import format_value, require, require_extra

FORMATS = {"c": ".c", "onnx": ".onnx"}
SHOWN = 10
"""Most differences that are printed."""


def add_export(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "agent",
        type=existing_agent,
        metavar="AGENT",
        help="any player: its name, or a .safetensors file",
    )
    parser.add_argument("--to", choices=FORMATS, required=True, help="C99, or ONNX")
    parser.add_argument(
        "--out", type=new_file(*FORMATS.values()), required=True, help="file to write: .c or .onnx"
    )
    parser.add_argument(
        "--game",
        type=existing_game,
        help="name or file (default: the one that the agent was made for)",
    )
    parser.add_argument(
        "--side", choices=SIDES, help="of a player that plays either (default: the agent's own)"
    )
    parser.add_argument(
        "--constants",
        action="store_true",
        help="weights in the C source instead of a file beside it",
    )
    parser.set_defaults(run=run_export)


def run_export(options: argparse.Namespace) -> int:
    """Write the files and check them."""
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.catalogue import find_player
    from apollonius.export.player import exported_side, find_exportable, training_game
    from apollonius.export.writing import STATES, write_c, write_onnx

    name = options.agent
    out = options.out
    suffix = FORMATS[options.to]
    require(
        out.suffix == suffix, "--out", out, f"a file that ends in {suffix} for --to {options.to}"
    )
    require(
        not options.constants or options.to == "c",
        "--constants",
        "given",
        "left out: a model in ONNX has its weights",
    )
    role = exported_side(name, options.side)
    game = game_in_one_arena(options.game, "export") if options.game else training_game(name)
    options.display.begin_task(f"writing the player and comparing it in {STATES:,} states")
    warn(options, game, [find_player(name, role, game)])
    player = find_exportable(name, role, game)
    files, about = (
        write_c(player, out, options.constants) if options.to == "c" else write_onnx(player, out)
    )
    options.display.stop()
    print(*about, sep="\n")
    print_next_step(options, *files)
    return 0


def add_replay(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--bag",
        type=player_or_file,
        required=True,
        help="folder of a bag that the ROS 2 node wrote",
    )
    parser.add_argument(
        "agent", type=existing_agent, metavar="AGENT", nargs="?", help="(default: that of the bag)"
    )
    parser.add_argument("--game", type=existing_game, help="(default: that of the bag)")
    add_json(parser)
    parser.set_defaults(run=run_replay)


def run_replay(options: argparse.Namespace) -> int:
    """Print where the agent would have acted otherwise."""
    require_extra("bag", "replay")
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.export.bag import load_bag, recompute_decisions

    bag = load_bag(Path(options.bag))
    game = game_in_one_arena(options.game, "replay") if options.game else bag.game
    options.display.begin_task("asking the agent again")
    name = options.agent or bag.player
    differences, num_decisions = recompute_decisions(bag, name, game), len(bag.player_decisions)
    braked = len(bag.decisions) - num_decisions
    lines = [
        f"{format_value(name)} in the {num_decisions:,} states of {options.bag}, "
        f"a run of {format_value(bag.player)}",
        f"  acts otherwise in {len(differences):,}; {braked:,} more steps braked",
    ]
    rows = [("  time", "step", "u1, u2 recorded", "u1, u2 now")]
    for difference in differences[:SHOWN]:
        recorded = "{:+.2f}, {:+.2f}".format(*difference["recorded"])
        recomputed = "{:+.2f}, {:+.2f}".format(*difference["recomputed"])
        time = f"  {difference['time']:.2f} s"
        rows.append((time, str(difference["step"]), recorded, recomputed))
    facts = {
        "player": name,
        "decisions": num_decisions,
        "braked": braked,
        "differences": differences,
    }
    print_result(options, facts, "\n".join([*lines, *(columns(rows) if differences else [])]))
    return 0
