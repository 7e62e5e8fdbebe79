"""`apollonius tournament`: every pursuer against every evader."""

import argparse

from apollonius.agents.names import SIDES
from apollonius.cli.options import (
    AGENT,
    add_game_options,
    add_json,
    add_workers,
    answer,
    chosen_rules,
    command,
    finish,
    jobs_run,
    warn,
)
from apollonius.cli.values import agent_of, count, new_file
from apollonius.io.limits import GAMES


def add_tournament(parser: argparse.ArgumentParser) -> None:
    about = f"{AGENT} (default: all that need no file and fit the game)"
    for side in SIDES:
        parser.add_argument(f"--{side}s", type=agent_of(side), nargs="+", metavar=side.upper(), help=about)
    parser.add_argument("--games", type=count(GAMES), default=1000, help="games in each match (default: %(default)s)")
    add_game_options(parser)
    parser.add_argument("--plot", type=new_file(".png"), metavar="FILE", help="draw win rates and ratings as .png")
    add_workers(parser, "matches", None)
    add_json(parser)
    parser.set_defaults(run=run_tournament)


def run_tournament(options: argparse.Namespace) -> int:
    from apollonius.arenas.file import find_game
    from apollonius.catalogue import find_player, player_names
    from apollonius.cli.terminal import tournament_table
    from apollonius.evaluate.match import Match, MatchResult, starting
    from apollonius.evaluate.tournament import play_tournament
    from apollonius.game.by_side import BySide
    from apollonius.game.types import ROLES

    game, viable = starting(find_game(options.game), options.starts)
    asked = BySide(options.pursuers, options.evaders)
    names = ROLES.map(lambda role: asked[role] or player_names(role, game))
    players = ROLES.map(lambda role: [find_player(name, role, game) for name in names[role]])
    warn(options, game, (*players.pursuer, *players.evader))

    def tell(match: Match, result: MatchResult) -> None:
        if not options.json:
            who = " against ".join(player.name for player in match.players)
            options.display.tell(f"{who}: {result.pursuer_win_rate:.1%}")

    options.display.begin(f"playing {len(players.pursuer) * len(players.evader)} matches", compiles=True)
    asked_for = game, players, options.games, options.seed, viable
    tournament = play_tournament(*asked_for, tell, options.display.report, jobs_run(options))
    if options.plot:
        from apollonius.show.matches import draw_tournament

        draw_tournament(tournament, options.plot)
    starts = options.starts or game.starts.speed
    settings = {"game": options.game, "starts": starts, "games": options.games, "seed": options.seed}
    answer(options, settings | tournament.to_dict(), tournament_table(tournament, starts))
    if options.plot:
        best = [side[rated.points.argmax()] for side, rated in zip(names, tournament.ratings, strict=True)]
        then = command("show", *best, *chosen_rules(options), "--out", "best.gif")
        finish(options.plot, then=then, json=options.json)
    return 0
