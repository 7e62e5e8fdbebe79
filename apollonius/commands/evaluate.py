"""`apollonius evaluate`: play many games between two agents and count."""

import argparse
import json
from pathlib import Path
from typing import Any

from apollonius.commands.options import AGENT, add_game_options, requested_game
from apollonius.errors import require


def add_evaluate(subparsers: Any) -> None:
    """The parser of `evaluate`."""
    parser = subparsers.add_parser("evaluate", help="play many games between two agents and count")
    parser.add_argument("pursuer", metavar="PURSUER", help=AGENT)
    parser.add_argument("evader", metavar="EVADER", help=AGENT)
    parser.add_argument("--games", type=int, default=1000, help="number of games (default: %(default)s)")
    add_game_options(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.add_argument("--record", type=int, default=0, metavar="K", help="write K games as replays, lost ones first")
    parser.add_argument(
        "--replays", type=Path, default=Path("replays"), metavar="DIR", help="folder of the replays (default: replays)"
    )
    parser.set_defaults(run=run_evaluate)


def run_evaluate(options: argparse.Namespace) -> int:
    """Play a match and print its result."""
    from apollonius.evaluate.match import count, play_games, record_game, worst_first
    from apollonius.game.types import Role
    from apollonius.replay import save_replay
    from apollonius.solve.catalogue import find_player
    from apollonius.terminal import match_table

    game = requested_game(options)
    pursuer = find_player(options.pursuer, Role.PURSUER, game)
    evader = find_player(options.evader, Role.EVADER, game)
    require(0 <= options.record <= options.games, "--record", options.record, f"from 0 to --games = {options.games}")
    viable = options.starts == "viable"
    results = play_games(game, pursuer.policy, evader.policy, options.games, options.seed, viable=viable)
    result = count(game, results, viable)
    if options.record:
        options.replays.mkdir(parents=True, exist_ok=True)
    for index in worst_first(results)[: options.record]:
        replay = record_game(game, pursuer, evader, options.games, options.seed, index, viable)
        save_replay(replay, options.replays / f"game-{index}-{replay.outcome.name.lower()}.json")
    if options.json:
        match = {"pursuer": pursuer.name, "evader": evader.name, "game": options.game, "starts": options.starts}
        print(json.dumps(match | {"seed": options.seed} | result.to_dict()))
    else:
        print(match_table(pursuer.name, evader.name, result))
    return 0
