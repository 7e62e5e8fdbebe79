"""`apollonius replay`: ask an agent again in the states that a robot recorded."""

import argparse
from dataclasses import asdict
from pathlib import Path

from apollonius.cli.options import add_json, answer
from apollonius.cli.terminal import columns
from apollonius.cli.values import known_agent, known_game, named
from apollonius.io.errors import require_extra

SHOWN = 10
"""Most differences that are printed."""


def add_replay(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--bag", type=named, required=True, help="folder of a bag that the ROS 2 node wrote")
    parser.add_argument("agent", type=known_agent, metavar="AGENT", nargs="?", help="(default: the one of the bag)")
    parser.add_argument("--game", type=known_game, help="(default: that of the bag)")
    add_json(parser)
    parser.set_defaults(run=run_replay)


def run_replay(options: argparse.Namespace) -> int:
    """Print where the agent would have acted otherwise."""
    require_extra("bag", "replay")
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.export.bag import ask_again, load_bag

    bag = load_bag(Path(options.bag))
    game = game_in_one_arena(options.game, "replay") if options.game else bag.game
    options.display.begin("asking the agent again", compiles=True)
    name = options.agent or bag.player
    found, asked = ask_again(bag, name, game), len(bag.asked)
    braked = len(bag.decisions) - asked
    lines = [
        f"{name} in the {asked:,} states of {options.bag}, a run of {bag.player}",
        f"  acts otherwise in {len(found):,}; {braked:,} more steps braked",
    ]
    rows = [("  time", "step", "u1, u2 then", "u1, u2 now")]
    for one in found[:SHOWN]:
        then, now = ("{:+.2f}, {:+.2f}".format(*controls) for controls in (one.then, one.now))
        rows.append((f"  {one.time:.2f} s", str(one.step), then, now))
    facts = {"player": name, "asked": asked, "braked": braked, "differences": [asdict(one) for one in found]}
    answer(options, facts, "\n".join([*lines, *(columns(rows) if found else [])]))
    return 0
