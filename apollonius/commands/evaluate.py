"""`apollonius evaluate`: play many games between two agents and count."""

import argparse
from typing import Any

from apollonius.commands.ending import finish_with_replays, write_replays
from apollonius.commands.options import add_match_options, check_records, match_facts, requested_match
from apollonius.document import to_json


def add_evaluate(subparsers: Any) -> None:
    """The parser of `evaluate`."""
    parser = subparsers.add_parser("evaluate", help="play many games between two agents and count")
    add_match_options(parser)
    parser.set_defaults(run=run_evaluate)


def run_evaluate(options: argparse.Namespace) -> int:
    """Play a match and print its result."""
    from apollonius.evaluate.match import count, play_games, record_game, worst_first
    from apollonius.terminal import match_table

    check_records(options, options.games, f"--games = {options.games}")
    match = requested_match(options, in_one_arena=options.record > 0)  # of which a replay is
    options.display.begin(f"playing {match.games:,} games", compiles=True)
    results = play_games(match, report=options.display.report)
    result = count(match, results)
    written = write_replays(options, "game", (record_game(match, index) for index in worst_first(results)))
    options.display.end()
    if options.json:
        print(to_json(match_facts(options, match) | result.to_dict()))
    else:
        print(match_table(match, result))
    finish_with_replays(written, options)
    return 0
