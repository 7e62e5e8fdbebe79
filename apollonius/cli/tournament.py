"""`apollonius tournament`: every pursuer against every evader."""

import argparse
from typing import Any

from apollonius.cli.options import AGENT, add_game_options, add_json, chosen_rules, command, finish, warn
from apollonius.cli.values import count, known_agent, new_file, new_folder
from apollonius.io.document import to_json
from apollonius.io.interrupts import go_on
from apollonius.io.limits import GAMES


def add_tournament(subparsers: Any) -> None:
    parser = subparsers.add_parser("tournament", help="play every pursuer against every evader")
    everyone = "default: all that need no file and fit the game"
    parser.add_argument("--pursuers", type=known_agent, nargs="+", metavar="PURSUER", help=f"{AGENT} ({everyone})")
    parser.add_argument(
        "--evaders", type=known_agent, nargs="+", metavar="EVADER", help=f"the same, for the other side ({everyone})"
    )
    parser.add_argument("--games", type=count(GAMES), default=1000, help="games in each match (default: %(default)s)")
    add_game_options(parser)
    parser.add_argument(
        "--keep",
        type=new_folder,
        metavar="DIR",
        help="keep matches in this folder, and do not play again what lies there",
    )
    parser.add_argument("--plot", type=new_file(".png"), metavar="FILE", help="draw win rates and ratings as .png")
    add_json(parser)
    parser.set_defaults(run=run_tournament)


def run_tournament(options: argparse.Namespace) -> int:
    from apollonius.arenas.file import find_game
    from apollonius.catalogue import find_player, player_names
    from apollonius.cli.terminal import tournament_table
    from apollonius.evaluate.match import MatchResult
    from apollonius.evaluate.start_filter import starting
    from apollonius.evaluate.tournament import play_tournament
    from apollonius.game.types import Role

    game, starts = starting(find_game(options.game), options.starts)
    pursuers, evaders = (
        [find_player(name, role, game) for name in names or player_names(role, game)]
        for role, names in ((Role.PURSUER, options.pursuers), (Role.EVADER, options.evaders))
    )

    warn(options, game, (*pursuers, *evaders))

    def tell(pursuer: str, evader: str, result: MatchResult) -> None:
        if not options.json:
            options.display.tell(f"{pursuer} against {evader}: {result.pursuer_win_rate:.1%}")

    if options.keep:
        go_on(f"the matches in {options.keep} are kept: give the same command again")
    options.display.begin(f"playing {len(pursuers) * len(evaders)} matches", compiles=True)
    tournament = play_tournament(
        game,
        pursuers,
        evaders,
        options.games,
        options.seed,
        tell,
        starts,
        options.keep,
        options.display.report,
    )
    if options.plot:
        from apollonius.show.matches import draw_tournament

        draw_tournament(tournament, options.plot)
    options.display.end()
    if options.json:
        settings = {"game": options.game, "starts": starts.word(game), "games": options.games, "seed": options.seed}
        print(to_json(settings | tournament.to_dict()))
    else:
        print(tournament_table(tournament, starts.word(game)))
    written = [path for path in (options.plot, options.keep) if path]
    if written:
        ratings = tournament.ratings
        best = [
            (asked or names)[points.tolist().index(max(points))]
            for asked, names, points in (
                (options.pursuers, tournament.pursuers, ratings.pursuers),
                (options.evaders, tournament.evaders, ratings.evaders),
            )
        ]
        finish(*written, then=command("show", *best, *chosen_rules(options), "--out", "best.gif"), json=options.json)
    return 0
