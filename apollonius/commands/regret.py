"""`apollonius regret`: how far an agent is from optimal play."""

import argparse
import json
from typing import TYPE_CHECKING, Any

from apollonius.commands.ending import finish_with_replays, write_replays
from apollonius.commands.options import (
    AGENT,
    add_game_options,
    add_grid_options,
    add_record_options,
    check_records,
    requested_grid,
)
from apollonius.commands.values import count, existing_file, named
from apollonius.errors import require
from apollonius.limits import GAMES, RECORDS, TARGETS

if TYPE_CHECKING:
    from apollonius.game.game import Game


def add_regret(subparsers: Any) -> None:
    """The parser of `regret`."""
    parser = subparsers.add_parser(
        "regret", help="how far an agent is from what is solved: standing targets, or the game of two"
    )
    parser.add_argument("agent", type=named, metavar="AGENT", help=AGENT)
    parser.add_argument("--games", type=count(GAMES), default=10_000, help="number of games (default: %(default)s)")
    parser.add_argument("--targets", type=count(TARGETS), help="places of the target, without --tables (default: 20)")
    parser.add_argument(
        "--tables", type=existing_file, nargs=2, metavar="FILE",
        help="the solved game from both sides (solve game): the card of a pursuer or an evader in it",
    )  # fmt: skip
    parser.add_argument(
        "--role", choices=("pursuer", "evader"), help="with --tables: the agent's side (default: pursuer)"
    )
    parser.add_argument(
        "--response-games", type=count(RECORDS), default=0, metavar="N",
        help="with --tables: also N games against an opponent that knows the agent, one hold ahead: a lower bound of "
        "what it can lose (default: none)",
    )  # fmt: skip
    add_record_options(parser, "with --tables: write the K games that cost most as replays")
    add_game_options(parser)
    add_grid_options(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.set_defaults(run=run_regret)


def run_regret(options: argparse.Namespace) -> int:
    """Measure and print."""
    from apollonius.arenas.file import find_game
    from apollonius.evaluate.match import starting

    require(options.starts != "viable", "--starts", options.starts, "rest or moving; the table says what can be had")
    game, _ = starting(find_game(options.game), options.starts)
    if options.tables:
        return _run_card(options, game)
    for name in ("role", "response_games", "record"):
        given = getattr(options, name)
        require(not given, f"--{name.replace('_', '-')}", given, "left out without --tables")
    return _run_regret(options, game)


def _run_regret(options: argparse.Namespace, game: "Game") -> int:
    """A pursuer against standing targets."""
    from apollonius.catalogue import find_player
    from apollonius.evaluate.regret import measure_regret
    from apollonius.game.types import Role
    from apollonius.solve.reach import make_chase
    from apollonius.terminal import regret_table

    pursuer = find_player(options.agent, Role.PURSUER, game)
    grid, hold = requested_grid(options, game, Role.PURSUER)
    targets = 20 if options.targets is None else options.targets

    display = options.display
    chase = make_chase(game, grid, hold)
    display.begin(f"solving for {targets} targets and playing", compiles=True)
    regret = measure_regret(
        chase, pursuer.policy, options.games, targets, options.seed, lambda done: display.report(done, targets)
    )
    display.end()
    if options.json:
        about = {"pursuer": pursuer.name, "game": options.game, "starts": options.starts, "seed": options.seed}
        print(json.dumps(about | {"grid": list(grid.counts), "hold": hold} | regret.to_dict()))
    else:
        print(regret_table(pursuer.name, regret))
    return 0


def _run_card(options: argparse.Namespace, game: "Game") -> int:
    """An agent in the solved game."""
    from apollonius.agents.kind import Named
    from apollonius.catalogue import find_player
    from apollonius.evaluate.card import WORST, measure_card
    from apollonius.evaluate.match import Match, record_game
    from apollonius.game.by_side import BySide
    from apollonius.game.types import Role
    from apollonius.solve.foresight import ResponsePolicy
    from apollonius.solve.solved import table_player
    from apollonius.terminal import card_table

    for name in ("targets", "grid", "hold"):
        given = getattr(options, name)
        require(given is None, f"--{name}", given, "left out with --tables, which know it")
    check_records(options, WORST, f"{WORST}")
    role = Role[(options.role or "pursuer").upper()]
    tables = [(path.stem, table_player(path, game)) for path in options.tables]
    sides = {table.zero_sum_game.role: table for _, table in tables}
    require(len(sides) == 2, "--tables", " ".join(map(str, options.tables)), "a pursuer's and an evader's")
    agent = find_player(options.agent, role, game)
    own, other = sides[role], sides[role.other]
    opponent = Named(next(name for name, table in tables if table is other), other)
    players = BySide.of(role, agent, opponent)
    match = Match(game, players, options.games, options.seed)
    response = ResponsePolicy(other.zero_sum_game, other.table, agent.policy) if options.response_games else None
    display = options.display
    display.begin("playing against the table", compiles=True)

    def report(opponent: str, done: int, total: int) -> None:
        if display.estimate.what != f"playing against the {opponent}":
            display.begin(f"playing against the {opponent}")
        display.report(done, total)

    card = measure_card(match, own, response, options.response_games, report)
    written = write_replays(options, "game", (record_game(match, lost["game"]) for lost in card.worst))
    display.end()
    if options.json:
        about = {"agent": agent.name, "game": options.game, "starts": options.starts, "seed": options.seed}
        print(json.dumps(about | {"tables": [path.name for path in options.tables]} | card.to_dict()))
    else:
        print(card_table(agent.name, card))
    finish_with_replays(written, options)
    return 0
