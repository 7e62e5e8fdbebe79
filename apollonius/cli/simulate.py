"""`apollonius simulate`: the games of a match between robots with bodies, beside the same games by the rules."""

import argparse
from dataclasses import asdict
from itertools import product
from typing import TYPE_CHECKING

from apollonius.cli.options import (
    add_match_options,
    add_vary,
    answer,
    check_records,
    finish,
    finish_with_replays,
    match_facts,
    requested_match,
    write_replays,
)
from apollonius.cli.show import GAME_FILE, save_game
from apollonius.cli.terminal import columns, match_heading
from apollonius.cli.values import existing_file
from apollonius.io.errors import require, require_extra
from apollonius.io.limits import SIMULATED_GAMES

if TYPE_CHECKING:
    from apollonius.evaluate.match import Match
    from apollonius.simulate.drive import Drive
    from apollonius.simulate.simulation import Comparison, Difference, Simulated


def add_simulate(parser: argparse.ArgumentParser) -> None:
    add_match_options(parser, SIMULATED_GAMES)
    parser.add_argument(
        "--drive", type=existing_file, metavar="FILE", help="a .toml file with the numbers of your own robots"
    )
    add_vary(parser)
    parser.add_argument("--out", type=GAME_FILE, metavar="FILE", help="the worst game as `show` writes it: game.gif")
    parser.set_defaults(run=run_simulate)


def run_simulate(options: argparse.Namespace) -> int:
    require_extra("sim", "simulate")
    from apollonius.evaluate.match import worst_first
    from apollonius.simulate.drive import load_drive
    from apollonius.simulate.simulation import record_course

    if options.vary:
        return _vary(options)
    check_records(options, options.games, f"--games = {options.games}")
    match, drive, display = requested_match(options, in_one_arena=True), load_drive(options.drive), options.display
    comparison, simulated = _compare(options, match, drive)
    worst = worst_first(simulated.results)
    written = write_replays(options, "bodies", (record_course(simulated, match, index) for index in worst))
    if options.out:
        display.begin("drawing the worst game")
        save_game(record_course(simulated, match, worst[0]), options.out)
    answer(options, match_facts(options, match) | asdict(comparison), _table(match, comparison))
    finish_with_replays(written, options)
    if options.out:
        finish(options.out)
    return 0


def _compare(options: argparse.Namespace, match: "Match", drive: "Drive") -> tuple["Comparison", "Simulated"]:
    """Play a match with bodies and by the rules."""
    from apollonius.evaluate.match import play_games
    from apollonius.simulate.simulation import compare, simulate_match

    options.display.begin("playing with bodies", compiles=True)
    simulated = simulate_match(match, drive, options.display.report)
    options.display.begin("playing by the rules", compiles=True)
    return compare(match, play_games(match, report=options.display.report), simulated), simulated


def _vary(options: argparse.Namespace) -> int:
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.evaluate.vary import Variation, varied_matches
    from apollonius.game.by_side import BySide
    from apollonius.simulate.drive import load_drive

    for name, given in (("--record", options.record), ("--out", options.out)):
        require(not given, name, given, "left out with --vary, which keeps no games")
    game, names = game_in_one_arena(options.game, "--vary"), BySide(options.pursuer, options.evader)
    variations = [Variation(*one) for one in options.vary]
    matches = varied_matches(game, names, variations, options.games, options.seed, options.starts)
    drive = load_drive(options.drive)
    found = [_compare(options, match, drive)[0] for match in matches]
    fields, values = [one.field for one in variations], [*product(*(one.values for one in variations))]
    rows = [(*fields, "wins by the rules", "with bodies", "difference")]
    for at, comparison in zip(values, found, strict=True):
        wins = comparison.differences["pursuer wins"]
        rows.append((*(f"{value:g}" for value in at), f"{wins.rules:.1%}", f"{wins.bodies:.1%}", _points(wins)))
    facts = [dict(zip(fields, at, strict=True)) | asdict(one) for at, one in zip(values, found, strict=True)]
    text = "\n".join([match_heading(matches[0]), *columns(rows)])
    answer(options, match_facts(options, matches[0]) | {"vary": fields, "matches": facts}, text)
    return 0


def _points(rate: "Difference") -> str:
    low, high = (f"{100 * end:+.1f}" for end in rate.interval)
    return f"{low} to {high} points (95 %)"


def _table(match: "Match", comparison: "Comparison") -> str:
    by_rules, with_bodies = comparison.rules.outcomes, comparison.bodies.outcomes
    rows = [("", "by the rules", "with bodies", "difference")]
    rows += [
        (f"  {name.replace('_', ' ')}", f"{count:,}", f"{with_bodies[name]:,}", "")
        for name, count in by_rules.items()
        if count or with_bodies[name]
    ]
    for event, rate in comparison.differences.items():
        rows.append((f"  {event}", f"{rate.rules:.1%}", f"{rate.bodies:.1%}", _points(rate)))
    return "\n".join([match_heading(match), *columns(rows)])
