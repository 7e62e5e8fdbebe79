"""`apollonius evaluate`, `simulate`, `tournament` and `suite`: games counted, and the cards of the
benchmark.
"""

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from apollonius.agents.names import SIDES
from apollonius.cli.options import (
    AGENT,
    add_game_options,
    add_json,
    add_match_options,
    add_workers,
    chosen_rules,
    jobs_run,
    print_next_step,
    print_result,
    print_sweep,
    print_with_replays,
    requested_match,
    require_replays,
    shell_command,
    warn,
)
from apollonius.cli.terminal import comparison_table, match_table, scenarios_table, tournament_table
from apollonius.cli.values import (
    agent_of,
    agent_or_model,
    existing_file,
    new_file,
    scenario_or_file,
    whole_number,
)
from apollonius.io.errors import require, require_extra
from apollonius.io.limits import GAMES, ONNX, SIMULATED_GAMES

if TYPE_CHECKING:
    from apollonius.benchmark.card import SuiteCard
    from apollonius.game.types import Role


TRACKS = ("full", "lidar", "team")
"""Parts of the benchmark."""


def add_evaluate(parser: argparse.ArgumentParser) -> None:
    add_match_options(parser)
    parser.add_argument(
        "--out", type=new_file(".png"), metavar="FILE", help="draw the wins of --vary as .png"
    )
    parser.set_defaults(run=run_evaluate)


def add_simulate(parser: argparse.ArgumentParser) -> None:
    add_match_options(parser, SIMULATED_GAMES)
    about = (
        "your robots' numbers, as examples/robots/turtlebot4.toml; "
        "docs/reference/game_files.md has all keys"
    )
    parser.add_argument("--drive", type=existing_file, metavar="FILE", help=about)
    parser.set_defaults(run=run_simulate, out=None)


def run_evaluate(options: argparse.Namespace) -> int:
    from apollonius.evaluate.match import (
        count_results,
        play_games,
        play_match,
        record_game,
        worst_first,
    )

    if options.vary:
        return print_sweep(options, play_match)
    require(options.out is None, "--out", options.out, "given with --vary, whose values it draws")
    require_replays(options)
    match = requested_match(options, in_one_arena=options.record > 0)  # of which a replay is
    options.display.begin_task(f"playing {match.games:,} games")
    results = play_games(match, report=options.display.report)
    result = count_results(match, results)
    games = (record_game(match, index) for index in worst_first(results))
    return print_with_replays(
        options, match, result.to_dict(), match_table(match, result), "game", games
    )


def run_simulate(options: argparse.Namespace) -> int:
    """Play with bodies, and the same games by the rules."""
    require_extra("sim", "simulate")
    from apollonius.evaluate.match import count_results, play_games, worst_first
    from apollonius.simulate.drive import load_drive
    from apollonius.simulate.simulation import compare_physics, record_course, simulate_match

    drive, display = load_drive(options.drive), options.display
    if options.vary:
        return print_sweep(
            options,
            lambda match, report: count_results(
                match, simulate_match(match, drive, report).results
            ),
        )
    require_replays(options)
    match = requested_match(options, in_one_arena=True)
    display.begin_task("playing with bodies")
    simulated = simulate_match(match, drive, display.report)
    display.begin_task("playing by the rules")
    comparison = compare_physics(match, play_games(match, report=display.report), simulated)
    courses = (record_course(simulated, match, index) for index in worst_first(simulated.results))
    text = comparison_table(match, comparison)
    return print_with_replays(options, match, asdict(comparison), text, "bodies", courses)


def add_tournament(parser: argparse.ArgumentParser) -> None:
    about = f"{AGENT} (default: all that need no file and fit the game)"
    for side in SIDES:
        parser.add_argument(
            f"--{side}s", type=agent_of(side), nargs="+", metavar=side.upper(), help=about
        )
    parser.add_argument(
        "--games",
        type=whole_number(GAMES),
        default=1000,
        help="games in each match (default: %(default)s)",
    )
    add_game_options(parser)
    parser.add_argument(
        "--plot", type=new_file(".png"), metavar="FILE", help="draw win rates and ratings as .png"
    )
    add_workers(parser, "matches")
    add_json(parser)
    parser.set_defaults(run=run_tournament)


def run_tournament(options: argparse.Namespace) -> int:
    from apollonius import BySide, find_game, find_player
    from apollonius.catalogue import player_names
    from apollonius.evaluate.match import with_start_speeds
    from apollonius.evaluate.tournament import play_tournament
    from apollonius.game.types import ROLES

    game = with_start_speeds(find_game(options.game), options.starts)
    requested = BySide(options.pursuers, options.evaders)
    names = ROLES.map(lambda role: requested[role] or player_names(role, game))
    players = ROLES.map(lambda role: [find_player(name, role, game) for name in names[role]])
    warn(options, game, (*players.pursuer, *players.evader))

    options.display.begin_task(f"playing {len(players.pursuer) * len(players.evader)} matches")
    arguments = game, players, options.games, options.seed
    tournament = play_tournament(*arguments, options.display.report, jobs_run(options))
    starts = game.starts.speed
    settings = {
        "game": options.game,
        "starts": starts,
        "games": options.games,
        "seed": options.seed,
    }
    print_result(options, settings | tournament.to_dict(), tournament_table(tournament, starts))
    if options.plot:
        from apollonius.show.matches import draw_tournament

        draw_tournament(tournament, options.plot)
        best = [
            side[rated.points.argmax()]
            for side, rated in zip(names, tournament.ratings, strict=True)
        ]
        then = shell_command("show", *best, *chosen_rules(options), "--out", "best.gif")
        print_next_step(options, options.plot, then=then)
    return 0


def add_suite(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    judge_parser = actions.add_parser(
        "judge", help="play all games of the benchmark and write a card"
    )
    _add_entry(judge_parser)
    judge_parser.add_argument(
        "--track",
        choices=TRACKS,
        default="full",
        help="the benchmark's part (default: %(default)s)",
    )
    judge_parser.add_argument(
        "--out", type=new_file(".json"), default=Path("card.json"), help="default: card.json"
    )
    add_workers(judge_parser, "rounds")
    judge_parser.set_defaults(run=run_judge)
    verify_parser = actions.add_parser(
        "verify", help="replay games of a card, and refuse one that differs"
    )
    verify_parser.add_argument("card", type=existing_file, metavar="CARD")
    verify_parser.add_argument(
        "--agent", type=agent_or_model, metavar="FILE", help="of an agent that lies elsewhere"
    )
    verify_parser.add_argument(
        "--all", action="store_true", help="play all its games (default: half, drawn at random)"
    )
    verify_parser.set_defaults(run=run_verify)
    scenarios_parser = actions.add_parser(
        "scenarios", help="play situations that its side can win against many replies"
    )
    _add_entry(scenarios_parser)
    scenarios_parser.add_argument(
        "--only",
        type=scenario_or_file,
        nargs="+",
        metavar="SCENARIO",
        help="names or .json files (default: all)",
    )
    scenarios_parser.set_defaults(run=run_scenarios)
    for action in (judge_parser, verify_parser, scenarios_parser):
        add_json(action)


def _add_entry(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of an agent that is judged."""
    parser.add_argument(
        "agent", type=agent_or_model, metavar="AGENT", help=f"{AGENT}; or an .onnx file"
    )
    parser.add_argument(
        "--side", choices=SIDES, help="of an agent from outside, or that plays either"
    )


def run_judge(options: argparse.Namespace) -> int:
    from apollonius.benchmark.card import judge_agent
    from apollonius.benchmark.track import Benchmark
    from apollonius.io.document import to_json, write_atomically

    require(not options.out.exists(), "--out", options.out, "a new file; choose another name")
    role = _judged_role(options)
    options.display.begin_task("playing the benchmark")
    card = judge_agent(
        Benchmark(options.track, role), options.agent, options.display.report, jobs_run(options)
    )
    write_atomically(options.out, to_json(asdict(card)).encode())
    _print_card(options, card)
    print_next_step(options, options.out, then=shell_command("suite", "verify", options.out))
    return 0


def _judged_role(options: argparse.Namespace) -> "Role":
    from apollonius.export.player import exported_side
    from apollonius.game.types import Role

    if not options.agent.endswith(ONNX):
        return exported_side(options.agent, options.side)
    bound = "given for an agent from outside: pursuer or evader"
    require(options.side, "--side", None, bound)
    return Role[options.side.upper()]


def run_scenarios(options: argparse.Namespace) -> int:
    from apollonius.benchmark.scenarios import find_scenarios, play_scenarios

    role = _judged_role(options)
    scenarios = find_scenarios(role, options.only)
    options.display.begin_task(f"playing {len(scenarios)} scenarios")
    results = play_scenarios(options.agent, scenarios, options.display.report)
    solved = sum(result.is_solved for result in results)
    facts = {
        "agent": options.agent,
        "solved": solved,
        "scenarios": [asdict(result) for result in results],
    }
    print_result(options, facts, scenarios_table(options.agent, results))
    return 0


def run_verify(options: argparse.Namespace) -> int:
    from apollonius.benchmark.card import verify

    options.display.begin_task("playing games of the card")
    card = verify(options.card, options.agent, options.all, options.display.report)
    _print_card(options, card, "it comes out: ")
    return 0


def _print_card(options: argparse.Namespace, card: "SuiteCard", before: str = "") -> None:
    score = card.score
    text = (
        f"{before}{card.agent} ({card.side}, {card.track}): {score.net_win_rate:+.3f} "
        f"[{score.interval[0]:+.3f}, {score.interval[1]:+.3f}] against {score.opponent}, "
        f"worst tenth {score.worst_tenth:+.3f}, crashes {score.crashes:.1%}, "
        f"forfeits {score.forfeits:.1%}, {card.decision_us:.4g} us a decision"
    )
    failures = {
        game_round.failure for rounds in card.opponents.values() for game_round in rounds
    } - {""}
    facts = {
        "agent": card.agent,
        "side": card.side,
        "track": card.track,
        "decision_us": card.decision_us,
    }
    print_result(options, facts | asdict(score), "\nit failed: ".join([text, *sorted(failures)]))
