"""`apollonius simulate`: the games of a match between robots with bodies, beside the same games by the rules."""

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

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
from apollonius.cli.terminal import columns, match_heading
from apollonius.cli.values import existing_file
from apollonius.io.errors import require_extra
from apollonius.io.limits import SIMULATED_GAMES

if TYPE_CHECKING:
    from apollonius.evaluate.match import Match
    from apollonius.simulate.simulation import Comparison


def add_simulate(parser: argparse.ArgumentParser) -> None:
    add_match_options(parser, SIMULATED_GAMES)
    parser.add_argument(
        "--drive", type=existing_file, metavar="FILE", help="a .toml file with the numbers of your own robots"
    )
    parser.set_defaults(run=run_simulate, out=None)


def run_simulate(options: argparse.Namespace) -> int:
    require_extra("sim", "simulate")
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
    written = write_replays(options, "bodies", courses)
    answer(options, match_facts(options, match) | asdict(comparison), _table(match, comparison))
    finish_with_replays(written, options)
    return 0


def _table(match: "Match", comparison: "Comparison") -> str:
    by_rules, with_bodies = comparison.rules.outcomes, comparison.bodies.outcomes
    rows = [("", "by the rules", "with bodies", "difference")]
    rows += [
        (f"  {name.replace('_', ' ')}", f"{count:,}", f"{with_bodies[name]:,}", "")
        for name, count in by_rules.items()
        if count or with_bodies[name]
    ]
    for event, rate in comparison.differences.items():
        low, high = (f"{100 * end:+.1f}" for end in rate.interval)
        rows.append((f"  {event}", f"{rate.rules:.1%}", f"{rate.bodies:.1%}", f"{low} to {high} points (95 %)"))
    return "\n".join([match_heading(match), *columns(rows)])
