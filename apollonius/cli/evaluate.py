"""`apollonius evaluate`: play many games between two agents and count; vary numbers of the game."""

import argparse

from apollonius.cli.options import (
    add_match_options,
    answer,
    answer_varied,
    check_records,
    finish_with_replays,
    match_facts,
    requested_match,
    write_replays,
)
from apollonius.cli.values import new_file
from apollonius.io.errors import require


def add_evaluate(parser: argparse.ArgumentParser) -> None:
    add_match_options(parser)
    parser.add_argument(
        "--out", type=new_file(".png"), metavar="FILE", help="draw the pursuer's wins over the varied numbers as .png"
    )
    parser.set_defaults(run=run_evaluate)


def run_evaluate(options: argparse.Namespace) -> int:
    from apollonius.cli.terminal import match_table
    from apollonius.evaluate.match import count, play_games, play_match, record_game, worst_first

    if options.vary:
        return answer_varied(options, play_match)
    require(options.out is None, "--out", options.out, "given with --vary, whose values it draws")
    check_records(options, options.games, f"--games = {options.games}")
    match = requested_match(options, in_one_arena=options.record > 0)  # of which a replay is
    options.display.begin(f"playing {match.games:,} games", compiles=True)
    results = play_games(match, report=options.display.report)
    options.display.begin("judging the starts", compiles=True)
    result = count(match, results)
    written = write_replays(options, "game", (record_game(match, index) for index in worst_first(results)))
    answer(options, match_facts(options, match) | result.to_dict(), match_table(match, result))
    finish_with_replays(written, options)
    return 0
