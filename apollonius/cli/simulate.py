"""`apollonius simulate`: the games of a match between robots with bodies, beside the same games by the rules."""

import argparse
from typing import TYPE_CHECKING, Any

from apollonius.cli.options import (
    add_match_options,
    check_records,
    finish_with_replays,
    match_facts,
    requested_match,
    write_replays,
)
from apollonius.cli.values import existing_file
from apollonius.io.document import to_json
from apollonius.io.errors import require_extra
from apollonius.io.limits import SIMULATED_GAMES

if TYPE_CHECKING:
    from apollonius.simulate.simulation import Comparison


def add_simulate(subparsers: Any) -> None:
    parser = subparsers.add_parser("simulate", help="play many games between robots with bodies, in MuJoCo")
    add_match_options(parser, SIMULATED_GAMES)
    parser.add_argument(
        "--drive", type=existing_file, metavar="FILE", help="a .toml file with what is other about your robots"
    )
    parser.set_defaults(run=run_simulate)


def run_simulate(options: argparse.Namespace) -> int:
    require_extra("sim", "simulate")
    from apollonius.cli.terminal import match_heading
    from apollonius.evaluate.match import play_games, worst_first
    from apollonius.simulate.drive import load_drive
    from apollonius.simulate.simulation import compare, record_course, simulate_match

    check_records(options, options.games, f"--games = {options.games}")
    match, drive, display = requested_match(options, in_one_arena=True), load_drive(options.drive), options.display
    display.plan({"playing with bodies": 1.0, "playing by the rules": 0.1})
    display.begin("playing with bodies", compiles=True)
    simulated = simulate_match(match, drive, display.report)
    display.begin("playing by the rules", compiles=True)
    rules = play_games(match, report=display.report)
    comparison = compare(match, rules, simulated)
    worst = worst_first(simulated.results)
    written = write_replays(options, "bodies", (record_course(simulated, match, index) for index in worst))
    display.end()
    if options.json:
        print(to_json(match_facts(options, match) | comparison.to_dict()))
    else:
        print(match_heading(match))
        print(_table(comparison))
    finish_with_replays(written, options)
    return 0


def _table(comparison: "Comparison") -> str:
    lines = [f"  {'':<22}{'by the rules':>14}{'with bodies':>14}"]
    for name, by_rules in comparison.rules.outcomes.items():
        lines.append(f"  {name.replace('_', ' '):<22}{by_rules:>14,}{comparison.bodies.outcomes[name]:>14,}")
    lines += [
        f"  {event:<22}{rate.rules:>14.1%}{rate.bodies:>14.1%}   {100 * rate.difference:+.1f} points, "
        f"95 % interval {100 * rate.interval[0]:+.1f} to {100 * rate.interval[1]:+.1f}"
        for event, rate in comparison.differences.items()
    ]
    lines.append("  one step of a body from one by the rules, root mean square and 95th percentile:")
    units = {"speed": "m/s", "heading": "rad", "position": "m"}
    for side, errors in comparison.tracking.items():
        said = [f"{what} {error.rms:.4f}, {error.p95:.4f} {units[what]}" for what, error in errors.items()]
        lines.append(f"  {side:<10}{'; '.join(said)}")
    return "\n".join(lines)
