"""`apollonius robots`: who wins where, with robots of other makes."""

import argparse
from typing import TYPE_CHECKING, Any

from apollonius.commands.ending import command, finish
from apollonius.commands.options import AGENT, add_game_options, chosen_rules
from apollonius.commands.values import count, known_agent, length, new_file, ratio
from apollonius.document import to_json
from apollonius.limits import GAMES

if TYPE_CHECKING:
    pass


def add_robots(subparsers: Any) -> None:
    """The parser of `robots`."""
    parser = subparsers.add_parser("robots", help="who wins with a faster, nimbler pursuer and larger bodies")
    parser.add_argument("pursuer", type=known_agent, metavar="PURSUER", help=AGENT)
    parser.add_argument("evader", type=known_agent, metavar="EVADER", help=AGENT)
    for name, what, usual in (
        ("--speed", "top speeds of the pursuer, in those of the evader; its acceleration stays", [0.8, 1.0, 1.25, 1.5]),
        ("--turn", "largest turn rates of the pursuer, in those of the evader", [0.5, 1.0, 2.0]),
    ):
        told = " ".join(f"{number:g}" for number in usual)
        parser.add_argument(
            name, type=ratio, nargs="+", default=usual, metavar="RATIO", help=f"{what} (default: {told})"
        )
    parser.add_argument(
        "--radius", type=length, nargs="+", default=[0.0, 0.1, 0.2], metavar="M",
        help="radii of both bodies [m]; the gap between them at which the evader is caught stays (default: 0 0.1 0.2)",
    )  # fmt: skip
    parser.add_argument("--games", type=count(GAMES), default=200, help="games with each make (default: %(default)s)")
    add_game_options(parser)
    parser.add_argument("--out", type=new_file(".png"), metavar="FILE", help="draw who wins where as .png")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.set_defaults(run=run_robots)


def run_robots(options: argparse.Namespace) -> int:
    """Play all matches, print the table, draw the map."""
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.evaluate.makes import play_makes
    from apollonius.evaluate.start_filter import starting
    from apollonius.game.by_side import BySide
    from apollonius.terminal import make_table

    game, starts = starting(game_in_one_arena(options.game, "robots"), options.starts)
    options.display.begin("playing robots of every make", compiles=True)
    table = play_makes(
        game,
        BySide(options.pursuer, options.evader),
        options.speed,
        options.turn,
        options.radius,
        options.games,
        options.seed,
        starts,
        options.display.report,
    )
    if options.out:
        from apollonius.show.makes import draw_makes

        draw_makes(table, options.out)
    options.display.end()
    if options.json:
        names = {"pursuer": table.pursuer, "evader": table.evader}
        rules = {"game": options.game, "starts": starts.word(game), "games": options.games, "seed": options.seed}
        print(to_json(names | rules | table.to_dict()))
    else:
        print(make_table(table), f"starts: {starts.word(game)}", sep="\n")
    if options.out:
        watch = command("show", options.pursuer, options.evader, *chosen_rules(options), "--out", "game.gif")
        finish(options.out, then=watch, json=options.json)
    return 0
