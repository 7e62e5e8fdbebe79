"""`apollonius simulate`: the games of a match between robots with bodies, beside the same games by the rules."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.commands.ending import finish_with_replays
from apollonius.commands.options import add_match_options, requested_match
from apollonius.commands.values import existing_file
from apollonius.limits import SIMULATED_GAMES

if TYPE_CHECKING:
    from apollonius.bodies.comparison import Comparison
    from apollonius.bodies.drive import Drive


def add_simulate(subparsers: Any) -> None:
    """The parser of `simulate`."""
    parser = subparsers.add_parser("simulate", help="play many games between robots with bodies, in MuJoCo")
    add_match_options(parser, SIMULATED_GAMES)
    parser.add_argument(
        "--drive", type=existing_file, metavar="FILE", help="a .toml file with what is other about your robots"
    )
    parser.add_argument("--ablate", action="store_true", help="say what the gap is due to: leave out part after part")
    parser.set_defaults(run=run_simulate)


def run_simulate(options: argparse.Namespace) -> int:
    """Play a match by the rules and with bodies, and print both."""
    from apollonius.bodies.comparison import compare
    from apollonius.bodies.drive import PARTS, without
    from apollonius.bodies.simulation import record_course, simulate_match
    from apollonius.evaluate.match import play_games, worst_first
    from apollonius.replay import save_replay

    game, pursuer, evader = requested_match(options)
    drive, viable = _drive(options.drive), options.starts == "viable"
    match = game, pursuer.policy, evader.policy, options.games, options.seed
    kinds = {f"without {part}": (part,) for part in PARTS} | {"without all of these": tuple(PARTS)}
    display, ablated = options.display, kinds if options.ablate else {}
    display.plan({"playing with bodies": 1.0, "playing by the rules": 0.1} | dict.fromkeys(ablated, 1.0))
    display.begin("playing with bodies", compiles=True)
    simulated = simulate_match(*match, drive, viable, display.report)
    display.begin("playing by the rules", compiles=True)
    rules = play_games(*match, viable=viable, report=display.report)
    comparisons = {"as it is": compare(game, rules, simulated, viable)}
    for kind, parts in ablated.items():
        display.begin(kind, compiles=True)
        other = simulate_match(*match, without(drive, *parts), viable, display.report)
        comparisons[kind] = compare(game, rules, other, viable)
    if options.record:
        options.replays.mkdir(parents=True, exist_ok=True)
    written = []
    for index in worst_first(simulated.results)[: options.record]:
        replay = record_course(simulated, game, (pursuer.name, evader.name), options.seed, index)
        written.append(options.replays / f"bodies-{index}-{replay.outcome.name.lower()}.json")
        save_replay(replay, written[-1])
    display.end()
    if options.json:
        asked = {"pursuer": pursuer.name, "evader": evader.name, "game": options.game, "starts": options.starts}
        found = {kind: comparison.to_dict() for kind, comparison in comparisons.items()}
        print(json.dumps(asked | {"seed": options.seed, "drives": found}))
    else:
        print(f"{pursuer.name} (pursuer) against {evader.name} (evader), {options.games:,} games")
        print(_table(comparisons["as it is"]))
        for kind, comparison in list(comparisons.items())[1:]:
            print(f"{kind}:", *_differences(comparison), sep="\n")
    finish_with_replays(written, options)
    return 0


def _drive(path: Path | None) -> "Drive":
    """The drive of a file, or the one that is built in."""
    from apollonius.arenas.record import from_dict
    from apollonius.bodies.drive import Drive
    from apollonius.document import parse_toml, read_bytes

    if path is None:
        return Drive()
    return from_dict(Drive, parse_toml(read_bytes(path, "a drive's .toml file", "check the path"), path), f"'{path}'")


def _table(comparison: "Comparison") -> str:
    lines = [f"  {'':<22}{'by the rules':>14}{'with bodies':>14}"]
    for name, by_rules in comparison.rules.outcomes.items():
        lines.append(f"  {name.replace('_', ' '):<22}{by_rules:>14,}{comparison.bodies.outcomes[name]:>14,}")
    lines += _differences(comparison)
    lines.append("  one step of a body from one by the rules, root mean square and 95th percentile:")
    units = {"speed": "m/s", "heading": "rad", "position": "m"}
    for side, errors in comparison.tracking.items():
        said = [f"{what} {error.rms:.4f}, {error.p95:.4f} {units[what]}" for what, error in errors.items()]
        lines.append(f"  {side:<10}{'; '.join(said)}")
    return "\n".join(lines)


def _differences(comparison: "Comparison") -> list[str]:
    return [
        f"  {event:<22}{rate.rules:>14.1%}{rate.bodies:>14.1%}   {100 * rate.difference:+.1f} points, "
        f"95 % interval {100 * rate.interval[0]:+.1f} to {100 * rate.interval[1]:+.1f}"
        for event, rate in comparison.differences.items()
    ]
