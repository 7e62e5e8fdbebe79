"""Results as text: the progress of a training, and tables."""

from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from apollonius.agents.names import SIDES
from apollonius.io.errors import LONGEST_MESSAGE, format_value

if TYPE_CHECKING:
    from apollonius.benchmark.scenarios import ScenarioResult
    from apollonius.cli.display import Display
    from apollonius.evaluate.learning import Curve
    from apollonius.evaluate.match import Match, MatchResult
    from apollonius.evaluate.solved import RegretCard
    from apollonius.evaluate.tournament import Advice, Tournament
    from apollonius.evaluate.vary import VariedMatches
    from apollonius.learn.metrics import MetricsLine
    from apollonius.learn.progress import Progress
    from apollonius.simulate.simulation import Comparison
    from apollonius.solve.grid import Sweep


def training_notes(line: "MetricsLine") -> dict[str, str]:
    """Return the metrics of a chunk of training in words, by name."""
    notes = {
        "env steps": f"{line.env_steps:,} ({line.env_steps_per_second:,}/s)",
        "episodes": f"{line.episodes:,}",
        "updates": f"{line.updates:,}",
        "loss": " ".join(f"{side} {loss:.3g}" for side, loss in line.losses.items()),
        "exploring games": _in_words(line.outcomes),
    }
    if line.evaluation:
        notes["greedy games"] = _in_words(line.evaluation.outcomes)
    return notes


def runs_table(runs: "Sequence[Progress]", below: Path) -> str:
    """Return training runs as lines of text; their names are paths below a folder."""
    rows = [("run", "state", "done", "pursuer wins", "machine", "last heard of")]
    for run in runs:
        name = format_value(
            run.folder.relative_to(below) if run.folder != below else run.folder.name
        )
        wins = "-" if run.evaluation is None else f"{run.evaluation.pursuer_win_rate:.1%}"
        machine = run.state.machine + (f" (Slurm {run.state.job})" if run.state.job else "")
        ago = "-" if run.age is None else f"{timedelta(seconds=round(run.age))} ago"
        rows.append(
            (name, run.state.state, f"{run.share:.0%}", wins, format_value(machine or "-"), ago)
        )
    errors = [
        format_value(f"{run.folder}: {run.state.error}", LONGEST_MESSAGE)
        for run in runs
        if run.state.error
    ]
    return "\n".join([*columns(rows), *errors])


def show_sweep(display: "Display", sweep: "Sweep") -> None:
    """Show a sweep of value iteration on a display."""
    display.report(sweep.share, 1)
    display.note({"sweep": f"{sweep.number}", "residual": f"{sweep.residual:.2e}"})


def match_heading(match: "Match") -> str:
    """Return a line that says what is played: the players, the number of games and their starts."""
    pursuer, evader = (player.name for player in match.players)
    return (
        f"{pursuer} (pursuer) against {evader} (evader), {match.games:,} games, starts: "
        f"{match.game.starts.speed}"
    )


_OWN_FAILURES = "hit_obstacle", "out_of_range"
"""Outcomes by which a side fails, after its name."""


def match_table(match: "Match", result: "MatchResult") -> str:
    """Return a match as lines of text: who wins more, who fails, and a bar for each outcome that
    occurred.
    """
    pursuer, evader = result.pursuer_win_interval, result.evader_win_interval
    winner = "Nobody surely"
    if pursuer[0] > evader[1]:
        winner = "The pursuer"
    elif evader[0] > pursuer[1]:
        winner = "The evader"
    lines = [f"{winner} wins more."]
    rates = result.pursuer_win_rate, result.evader_win_rate
    for side, player, rate, interval in zip(
        SIDES, match.players, rates, (pursuer, evader), strict=True
    ):
        failures = (
            sum(result.outcomes[f"{side}_{how}"] for how in _OWN_FAILURES)
            + result.outcomes["both_failed"]
        )
        lines.append(f"  {player.name} ({side}) wins {rate:.2%} of games {interval_text(interval)}")
        if failures:
            lines[-1] += f", loses {failures / result.games:.2%} by a failure of its own"
    lines.append(f"{match.games:,} games, starts: {match.game.starts.speed}")
    shares = _shares(result.outcomes)
    rows = [
        (f"  {name.replace('_', ' ')}", f"{share:.1%}", f"{result.outcomes[name]:,}")
        for name, share in shares
    ]
    lines += [f"{row}  {bar(share)}" for row, (_, share) in zip(columns(rows), shares, strict=True)]
    for side, sight in (result.sight or {}).items():
        lines.append(f"  the {side} sees an opponent in {sight.games / result.games:.1%} of games")
        if sight.first_steps is not None:
            lines[-1] += f", first after {sight.first_steps * float(match.game.dt):.1f} s (median)"
        lines[-1] += f", and in {sight.share:.1%} of all steps"
    for side, count in (result.unpromised or {}).items():
        lines.append(f"  from {count / result.games:.1%} of starts the {side}'s shield promises")
        lines[-1] += " nothing: there it finds no stop that is surely free"
    arenas = result.arenas
    if arenas:
        lines.append(
            f"  by arenas the pursuer wins {arenas.mean:.2%} {interval_text(arenas.interval)}, "
            "a mean of"
        )
        lines[-1] += f" {len(arenas.wins)}; {arenas.worst:.2%} in the worst tenth"
    return "\n".join(lines)


def bar(share: float, width: int = 40) -> str:
    """Return a share as a bar; of one that is not 0 at least a sliver is seen."""
    eighths = max(1, round(8 * width * share)) if share else 0
    return "█" * (eighths // 8) + " ▏▎▍▌▋▊▉"[eighths % 8].strip()


def interval_text(interval: tuple[float, float], form: str = ".2%") -> str:
    """Return a 95 % interval in words."""
    return "(95 % interval {:{form}} to {:{form}})".format(*interval, form=form)


def columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows as lines of text with aligned cells, the first to the left and the others to the
    right.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in rows
    ]


_QUARTERS = 0, 25, 50, 75, 100
"""Parts of a stage that a table of learning shows [%]."""


def learning_table(curves: "Sequence[Curve]") -> str:
    """Format learning curves as a table: a row for each curve, a column for each quarter of its
    stage.
    """
    rows = [("What they learned, by the stage", *[f"{percent} %" for percent in _QUARTERS])]
    for curve in curves:
        shares = [curve.wins.get(percent) for percent in _QUARTERS]
        cells = ["-" if share is None else f"{share:.1%}" for share in shares]
        rows.append((f"  {curve.title}", *cells))
    return "\n".join(columns(rows))


def comparison_table(match: "Match", comparison: "Comparison") -> str:
    """Return a match by the rules and with bodies as lines of text."""
    by_rules, with_bodies = comparison.rules.outcomes, comparison.bodies.outcomes
    rows = [("", "by the rules", "with bodies", "difference")]
    rows += [
        (f"  {name.replace('_', ' ')}", f"{count:,}", f"{with_bodies[name]:,}", "")
        for name, count in by_rules.items()
        if count or with_bodies[name]
    ]
    for event, rate in comparison.differences.items():
        low, high = (f"{100 * end:+.1f}" for end in rate.interval)
        rows.append(
            (
                f"  {event}",
                f"{rate.rules:.1%}",
                f"{rate.bodies:.1%}",
                f"{low} to {high} points (95 %)",
            )
        )
    return "\n".join([match_heading(match), *columns(rows)])


def tournament_table(tournament: "Tournament", starts: str) -> str:
    """Return the pursuers' win rates as lines of text, and below them the ratings."""
    rates = tournament.win_rates
    table = [["pursuer \\ evader", *tournament.evaders, "mean"]]
    for name, row in zip((*tournament.pursuers, "mean"), [*rates, rates.mean(axis=0)], strict=True):
        table.append([name, *[f"{rate:.1%}" for rate in [*row, row.mean()]]])
    ends = [match.pursuer_win_interval for row in tournament.matches for match in row]
    widest = 50 * max(high - low for low, high in ends)
    lines = [
        *columns(table),
        f"Starts: {starts}. 95 % intervals are within {widest:.1f} points of the rates.",
        "Elo:",
    ]
    for side, names, rated in zip(
        SIDES, (tournament.pursuers, tournament.evaders), tournament.ratings, strict=True
    ):
        ranked = sorted(zip(rated.points, rated.half_widths, names, strict=True), reverse=True)
        lines.append(
            f"  {side}s "
            + ", ".join(f"{name} {elo:.0f} ± {half:.0f}" for elo, half, name in ranked)
        )
    return "\n".join(lines)


def advice_table(advice: "Advice") -> str:
    """Return the pursuers' win rates as lines of text, the best players, and where the pursuer
    stops.
    """
    tournament = advice.tournament
    best = advice.best
    least = advice.least
    table = [["pursuer wins", *tournament.evaders]]
    for name, row in zip(tournament.pursuers, tournament.win_rates, strict=True):
        table.append([name, *[f"{rate:.0%}" for rate in row]])
    lines = [
        *columns(table),
        f"best pursuer: {best.pursuer}, "
        f"which wins at least {least.pursuer:.0%} of its games with each evader",
        f"best evader: {best.evader}, "
        f"not beaten in at least {least.evader:.0%} of its games with each pursuer",
    ]
    if advice.stops:
        places = ", ".join(f"({x:g}, {y:g})" for x, y in advice.stops)
        lines.append(
            f"places [m] where {best.pursuer} was when a standing evader was not caught in "
            f"time: {places}"
        )
    return "\n".join(lines)


def varied_table(varied: "VariedMatches") -> str:
    """Return a sweep as lines of text: a row for each value of the first number, a column for each
    of the second.
    """
    first, *second = varied.variations
    corner = " \\ ".join(variation.field for variation in varied.variations)
    header = [f"{value:g}" for value in second[0].values] if second else ["pursuer wins"]
    cells = [
        f"{100 * result.pursuer_win_rate:.1f} [{100 * low:.0f}, {100 * high:.0f}]"
        for result in varied.results
        for low, high in [result.pursuer_win_interval]
    ]
    table = [[corner, *header]]
    for row, value in enumerate(first.values):
        table.append([f"{value:g}", *cells[row * len(header) : (row + 1) * len(header)]])
    about = "the pursuer's wins in % of games, with 95 % intervals"
    return "\n".join([match_heading(varied.match), about, *columns(table)])


def card_table(agent: str, starts: str, card: "RegretCard") -> str:
    """Return a regret card as lines of text."""
    won = f"{card.won:.2%} {interval_text(card.won_interval)}"
    lost = f"{card.lost:.2%} {interval_text(card.lost_interval)}"
    return (
        f"{agent} ({card.role}) against the table: {card.games:,} games, starts: {starts}\n"
        f"  won {won}, lost {lost}\n"
        f"  payoff {card.payoff:+.3f} {interval_text(card.payoff_interval, '+.3f')}\n"
        f"  the tables promise {card.promised:+.3f} to {card.at_most:+.3f}: estimates, no bounds\n"
        f"  gap to what its own table promises {card.gap:.3f} "
        f"{interval_text(card.gap_interval, '.3f')}"
    )


def scenarios_table(agent: str, results: "Sequence[ScenarioResult]") -> str:
    """Return the scenarios that an agent played as lines of text."""
    rows = [("scenario", "goal", "won", "solved")]
    for result in results:
        verdict = "yes" if result.is_solved else "no"
        won = f"{result.won:,} of {result.replies:,}"
        rows.append((result.scenario, result.goal, won, verdict))
    solved = sum(result.is_solved for result in results)
    heading = f"{agent} solves {solved} of {len(results)}: wins against every reply that is played."
    failures = [f"{result.scenario}: {result.failure}" for result in results if result.failure]
    return "\n".join([heading, *columns(rows), *failures])


def _in_words(outcomes: dict[str, int]) -> str:
    return " ".join(f"{name} {share:.1%}" for name, share in _shares(outcomes)) or "none finished"


def _shares(outcomes: dict[str, int]) -> list[tuple[str, float]]:
    """Return the outcomes that occurred with their shares of all games, the most frequent first."""
    ranked = sorted(outcomes.items(), key=lambda item: -item[1])
    return [(name, count / sum(outcomes.values())) for name, count in ranked if count]
