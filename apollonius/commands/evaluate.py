"""`apollonius evaluate`: play many games between two agents and count."""

import argparse
import json
from typing import Any

from apollonius.commands.ending import finish_with_replays
from apollonius.commands.options import add_match_options, requested_match


def add_evaluate(subparsers: Any) -> None:
    """The parser of `evaluate`."""
    parser = subparsers.add_parser("evaluate", help="play many games between two agents and count")
    add_match_options(parser)
    parser.set_defaults(run=run_evaluate)


def run_evaluate(options: argparse.Namespace) -> int:
    """Play a match and print its result."""
    from apollonius.evaluate.match import count, play_games, record_game, worst_first
    from apollonius.replay import save_replay
    from apollonius.terminal import match_table

    game, pursuer, evader = requested_match(options)
    display = options.display
    viable = options.starts == "viable"
    display.begin(f"playing {options.games:,} games", compiles=True)
    results = play_games(
        game, pursuer.policy, evader.policy, options.games, options.seed, viable=viable, report=display.report
    )
    result = count(game, results, viable)
    if options.record:
        options.replays.mkdir(parents=True, exist_ok=True)
        display.begin(f"writing {options.record} replays")
    written = []
    for index in worst_first(results)[: options.record]:
        replay = record_game(game, pursuer, evader, options.games, options.seed, index, viable)
        written.append(options.replays / f"game-{index}-{replay.outcome.name.lower()}.json")
        save_replay(replay, written[-1])
    display.end()
    if options.json:
        match = {"pursuer": pursuer.name, "evader": evader.name, "game": options.game, "starts": options.starts}
        print(json.dumps(match | {"seed": options.seed} | result.to_dict()))
    else:
        print(match_table(pursuer.name, evader.name, result))
    finish_with_replays(written, options)
    return 0
