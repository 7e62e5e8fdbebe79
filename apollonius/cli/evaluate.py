"""`apollonius evaluate` and `simulate`: many games between two agents, counted, by the rules or with bodies."""

import argparse
from dataclasses import asdict

from apollonius.cli.options import (
    add_match_options,
    answer_varied,
    answer_with_replays,
    check_records,
    match_facts,
    requested_match,
)
from apollonius.cli.values import existing_file, new_file
from apollonius.io.errors import require, require_extra
from apollonius.io.limits import SIMULATED_GAMES


def add_evaluate(parser: argparse.ArgumentParser) -> None:
    add_match_options(parser)
    parser.add_argument(
        "--out", type=new_file(".png"), metavar="FILE", help="draw the pursuer's wins over the varied numbers as .png"
    )
    parser.set_defaults(run=run_evaluate)


def add_simulate(parser: argparse.ArgumentParser) -> None:
    add_match_options(parser, SIMULATED_GAMES)
    parser.add_argument(
        "--drive", type=existing_file, metavar="FILE", help="a .toml file with the numbers of your own robots"
    )
    parser.set_defaults(run=run_simulate, out=None)


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
    result, games = count(match, results), (record_game(match, index) for index in worst_first(results))
    facts = match_facts(options, match) | result.to_dict()
    return answer_with_replays(options, facts, match_table(match, result), "game", games)


def run_simulate(options: argparse.Namespace) -> int:
    """Play with bodies, and the same games by the rules."""
    require_extra("sim", "simulate")
    from apollonius.cli.terminal import comparison_table
    from apollonius.evaluate.match import count, play_games, worst_first
    from apollonius.simulate.drive import load_drive
    from apollonius.simulate.simulation import compare, record_course, simulate_match

    drive, display = load_drive(options.drive), options.display
    if options.vary:
        return answer_varied(options, lambda match, report: count(match, simulate_match(match, drive, report).results))
    check_records(options, options.games, f"--games = {options.games}")
    match = requested_match(options, in_one_arena=True)
    display.begin("playing with bodies", compiles=True)
    simulated = simulate_match(match, drive, display.report)
    display.begin("playing by the rules", compiles=True)
    comparison = compare(match, play_games(match, report=display.report), simulated)
    courses = (record_course(simulated, match, index) for index in worst_first(simulated.results))
    facts = match_facts(options, match) | asdict(comparison)
    return answer_with_replays(options, facts, comparison_table(match, comparison), "bodies", courses)
