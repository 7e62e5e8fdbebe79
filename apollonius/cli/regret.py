"""`apollonius regret`: how far an agent is from optimal play."""

import argparse
from dataclasses import asdict

from apollonius.cli.options import (
    AGENT,
    add_game_options,
    add_json,
    add_record_options,
    answer_with_replays,
    check_records,
    warn,
)
from apollonius.cli.solve import add_table_options, requested_tables
from apollonius.cli.values import count, known_agent
from apollonius.io.errors import require
from apollonius.io.limits import GAMES


def add_regret(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("agent", type=known_agent, metavar="AGENT", help=AGENT)
    parser.add_argument(
        "--role", choices=("pursuer", "evader"), default="pursuer", help="the agent's side (default: %(default)s)"
    )
    parser.add_argument("--games", type=count(GAMES), default=10_000, help="number of games (default: %(default)s)")
    add_table_options(parser)
    add_record_options(parser, "write the K games that cost most as replays")
    add_game_options(parser)
    add_json(parser)
    parser.set_defaults(run=run_regret)


def run_regret(options: argparse.Namespace) -> int:
    from apollonius.agents.kind import Named
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.catalogue import TABLE, find_player
    from apollonius.cli.terminal import card_table
    from apollonius.evaluate.card import WORST, measure_card
    from apollonius.evaluate.match import Match, record_game, starting
    from apollonius.game.by_side import BySide
    from apollonius.game.types import Role

    require(options.starts != "viable", "--starts", options.starts, "rest or moving; the table says what can be had")
    check_records(options, WORST, f"{WORST}")
    game, _ = starting(game_in_one_arena(options.game, "regret"), options.starts)
    starts = game.starts.speed
    role, display = Role[options.role.upper()], options.display
    agent = find_player(options.agent, role, game)
    warn(options, game, [agent])
    tables = requested_tables(options, game)
    own, other = tables[role], tables[role.other]
    match = Match(game, BySide.of(role, agent, Named(TABLE, other)), options.games, options.seed)
    display.begin("playing against the table", compiles=True)
    card = measure_card(match, own, other, display.report)
    about = {"agent": agent.name, "game": options.game, "starts": starts, "seed": options.seed}
    about["grid"] = list(own.zero_sum_game.grids[0].counts)
    games, text = (record_game(match, lost["game"]) for lost in card.worst), card_table(agent.name, starts, card)
    return answer_with_replays(options, about | asdict(card), text, "game", games)
