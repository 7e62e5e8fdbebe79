"""`apollonius show`: one game as a picture, an animation or a replay file."""

import argparse
import sys
from pathlib import Path
from typing import Any

from apollonius.commands.options import AGENT, add_game_options, plots, requested_game
from apollonius.commands.values import named, new_file

FORMATS = (".png", ".gif", ".webp", ".mp4", ".json")
"""How the names of its files end."""


def add_show(subparsers: Any) -> None:
    """The parser of `show`."""
    parser = subparsers.add_parser("show", help="a game as a picture or an animation, and as a replay file")
    parser.add_argument("pursuer", type=named, metavar="PURSUER|REPLAY", help=f"{AGENT}; or a replay file alone")
    parser.add_argument("evader", type=named, metavar="EVADER", nargs="?", help="the same, for the other side")
    add_game_options(parser)
    parser.add_argument(
        "--out", type=new_file(*FORMATS), default="game.gif",
        help="file to write: .png, .gif, .webp, .mp4 or a replay's .json (default: %(default)s)",
    )  # fmt: skip
    parser.set_defaults(run=run_show)


def run_show(options: argparse.Namespace) -> int:
    """One game, drawn or written as a replay."""
    from apollonius.replay import load_replay, save_replay
    from apollonius.show.animation import save_animation

    if options.evader is None:
        replay = load_replay(Path(options.pursuer))
        first = replay.first_difference()
        if first is not None:
            print(f"played again, this game differs from step {first} on", file=sys.stderr)
    else:
        from apollonius.evaluate.match import record_game
        from apollonius.game.types import Role
        from apollonius.solve.catalogue import find_player

        game = requested_game(options)
        pursuer = find_player(options.pursuer, Role.PURSUER, game)
        evader = find_player(options.evader, Role.EVADER, game)
        replay = record_game(game, pursuer, evader, 1, options.seed, 0, options.starts == "viable")
    options.out.parent.mkdir(parents=True, exist_ok=True)
    if options.out.suffix == ".json":
        save_replay(replay, options.out)
    elif options.out.suffix == ".png":
        with plots():
            from apollonius.show.arena import save_picture
        save_picture(replay, options.out)
    else:
        save_animation(replay, options.out)
    steps, outcome = len(replay.actions), replay.outcome.name.lower().replace("_", " ")
    seconds = steps * float(replay.game.dt)
    print(f"{replay.pursuer} against {replay.evader}: {outcome} after {seconds:.1f} s ({steps} steps); {options.out}")
    return 0
