"""`apollonius evaluate`: play many games between two agents and count; vary numbers of the game."""

import argparse

from apollonius.cli.options import (
    add_match_options,
    answer,
    check_records,
    finish,
    finish_with_replays,
    match_facts,
    requested_match,
    requested_matches,
    write_replays,
)
from apollonius.cli.values import new_file
from apollonius.io.errors import require


def add_evaluate(parser: argparse.ArgumentParser) -> None:
    add_match_options(parser)
    parser.add_argument(
        "--out", type=new_file(".png"), metavar="FILE", help="draw the pursuer's wins over the varied numbers as .png"
    )
    parser.add_argument("--verbose", action="store_true", help="print lengths of games, robots and detours too")
    parser.set_defaults(run=run_evaluate)


def run_evaluate(options: argparse.Namespace) -> int:
    from apollonius.cli.terminal import match_table
    from apollonius.evaluate.match import count, play_games, record_game, worst_first

    if options.vary:
        return _vary(options)
    require(options.out is None, "--out", options.out, "given with --vary, whose values it draws")
    check_records(options, options.games, f"--games = {options.games}")
    match = requested_match(options, in_one_arena=options.record > 0)  # of which a replay is
    options.display.begin(f"playing {match.games:,} games", compiles=True)
    results = play_games(match, report=options.display.report)
    options.display.begin("judging the starts", compiles=True)
    result = count(match, results)
    written = write_replays(options, "game", (record_game(match, index) for index in worst_first(results)))
    answer(options, match_facts(options, match) | result.to_dict(), match_table(match, result, options.verbose))
    finish_with_replays(written, options)
    return 0


def _vary(options: argparse.Namespace) -> int:
    from apollonius.cli.terminal import varied_table
    from apollonius.evaluate.vary import play_varied

    matches, variations = requested_matches(options)
    options.display.begin("playing a match for each value", compiles=True)
    found = play_varied(matches, variations, options.display.report)
    if options.out:
        from apollonius.show.matches import draw_varied

        draw_varied(found, options.out)
    answer(options, match_facts(options, found.match) | found.to_dict(), varied_table(found))
    if options.out:
        finish(options.out)
    return 0
