"""`apollonius arena`: is a game of one's own one that can be played?"""

import argparse
import json
from pathlib import Path
from typing import Any

from apollonius.errors import require


def add_arena(subparsers: Any) -> None:
    """The parser of `arena`."""
    parser = subparsers.add_parser("arena", help="check the arena of a game of one's own")
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    check = actions.add_parser("check", help="say what is wrong with a game's arena, and draw it")
    check.add_argument("game", metavar="GAME", help="a .toml file, or the name of a game")
    check.add_argument("--out", type=Path, metavar="PNG", help="write a picture of what was found")
    check.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    check.set_defaults(run=run_check)


def run_check(options: argparse.Namespace) -> int:
    """Survey the arena; exit status 1 where something is wrong with it."""
    from apollonius.game.file import find_game
    from apollonius.game.survey import survey
    from apollonius.show.plan import save_plan

    require(options.out is None or options.out.suffix == ".png", "--out", options.out, "a file that ends in .png")
    found = survey(find_game(options.game))
    if options.out:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        save_plan(found, options.out)
    if options.json:
        print(json.dumps({"game": options.game, "wrong": found.wrong, "notes": found.notes}))
    else:
        for line in found.wrong:
            print(f"wrong: {line}")
        for line in found.notes:
            print(f"note: {line}")
        if not found.wrong:
            print(f"{options.game}: nothing is wrong with this arena")
    return 1 if found.wrong else 0
