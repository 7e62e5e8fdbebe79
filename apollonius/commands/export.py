"""`apollonius export`: a trained agent as a file that needs no JAX."""

import argparse
from typing import Any

from apollonius.commands.options import command, finish
from apollonius.commands.values import known_agent, known_game, new_file
from apollonius.errors import InvalidInput, require

FORMATS = ("onnx", "c")


def add_export(subparsers: Any) -> None:
    parser = subparsers.add_parser("export", help="write a trained agent as ONNX or C, which need no JAX")
    parser.add_argument("agent", type=known_agent, metavar="AGENT", help="a zoo agent, or a .safetensors file")
    parser.add_argument("--to", choices=FORMATS, required=True, help="ONNX, or C99")
    parser.add_argument(
        "--out",
        type=new_file(".onnx", ".c"),
        required=True,
        help="file to write: .onnx or .c (with its .h)",
    )
    parser.add_argument(
        "--game",
        type=known_game,
        help="game that is built in: its name, or a .toml or .json file (default: the one the agent was made for)",
    )
    parser.set_defaults(run=run_export)


def run_export(options: argparse.Namespace) -> int:
    from apollonius.adapters.export.writing import STATES, find_exportable, find_format, game_of, write_policy
    from apollonius.arenas.file import find_game, game_in_one_arena
    from apollonius.arenas.record import to_dict

    name, out = options.agent, options.out
    agent, path = find_exportable(name)
    format_ = find_format(options.to)
    require(out.suffix == format_.SUFFIX, "--out", out, f"a file that ends in {format_.SUFFIX} for --to {options.to}")
    game = game_in_one_arena(options.game, "export") if options.game else game_of(agent, name)
    if game.scenario is not None:
        raise InvalidInput(f"'{name}' plays in any arena, and one is built in: say which, as --game office.")
    options.display.begin(f"writing the policy and comparing it in {STATES:,} states", compiles=True)
    written = write_policy(agent, path.stem, game, format_, out)
    options.display.end()
    print(*written.about, sep="\n")
    sides = (name, "random") if agent.header.role == "pursuer" else ("random", name)
    rules = ["--game", options.game] if options.game else []
    try_it = f"see what becomes of it on a robot with a body: {command('simulate', *sides, *rules, '--games', 300)}"
    at_home = options.game or to_dict(game.arena) == to_dict(find_game("paper").arena)
    finish(*written.files, then=try_it if at_home else "")
    return 0
