"""Results as text: the progress of a training, and tables."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from apollonius.cli.display import Display

if TYPE_CHECKING:
    from apollonius.evaluate.card import Card
    from apollonius.evaluate.match import Match, MatchResult
    from apollonius.evaluate.tournament import Tournament
    from apollonius.evaluate.vary import VariedMatches
    from apollonius.learn.metrics import MetricsLine
    from apollonius.solve.grid import Sweep


def training_notes(line: "MetricsLine") -> dict[str, str]:
    """Return the metrics of a chunk of training in words, by name."""
    notes = {
        "env steps": f"{line.env_steps:,} ({line.env_steps_per_second:,}/s)",
        "episodes": f"{line.episodes:,}",
        "updates": f"{line.updates:,}",
        "loss": " ".join(f"{side} {loss:.3g}" for side, loss in line.losses.items()),
        "exploring games": _shares(line.outcomes),
    }
    if line.evaluation:
        notes["greedy games"] = _shares(line.evaluation.outcomes)
    return notes


def sweeps_on(display: Display) -> "Callable[[Sweep], None]":
    """Return a report callback that shows sweeps of value iteration on a display."""
    first: list[float] = []

    def show(sweep: "Sweep") -> None:
        first.append(sweep.residual)
        display.report(sweep.share(first[0]), 1)
        display.note({"sweep": f"{sweep.number}", "residual": f"{sweep.residual:.2e}"})

    return show


def match_heading(match: "Match") -> str:
    """Return a line that says what is played: the players, the number of games and their starts."""
    pursuer, evader = (player.name for player in match.players)
    return f"{pursuer} (pursuer) against {evader} (evader), {match.games:,} games, starts: {match.starts_played}"


def match_table(match: "Match", result: "MatchResult") -> str:
    """Return a match as lines of text, in the order of the paper's Tables II and III."""
    width = max(len(name) for name in result.outcomes)
    lines = [match_heading(match)]
    lines += [
        f"  {name.replace('_', ' '):<{width}}  {count:>7,}  {count / result.games:>6.1%}"
        for name, count in result.outcomes.items()
    ]
    for side, rate, (low, high) in (
        ("pursuer wins", result.pursuer_win_rate, result.pursuer_win_interval),
        ("evader wins", result.evader_win_rate, result.evader_win_interval),
    ):
        lines.append(f"  {side:<{width}}  {rate:>7.2%}  95 % interval {low:.2%} to {high:.2%}")
    lines.append(f"  {'evader undefeated':<{width}}  {result.evader_undefeated_rate:>7.2%}")
    lines.append(f"  {'mean steps':<{width}}  {result.mean_steps:>7.1f}")
    if result.mean_capture_steps is not None and result.capture_steps_deviation is not None:
        lines.append(
            f"  {'mean capture steps':<{width}}  {result.mean_capture_steps:>7.1f}  "
            f"standard deviation {result.capture_steps_deviation:.1f}"
        )
    for side, change in (("pursuer", result.pursuer_change), ("evader", result.evader_change)):
        if change is not None:
            name = f"{side}'s change of u"
            parts = f"u1 {change[0]:.3f}, u2 {change[1]:.3f} of the largest, per step"
            lines.append(f"  {name:<{width}}  {sum(change) / 2:>7.3f}  {parts}")
    doomed = "unknown" if result.doomed_start_rate is None else f"{result.doomed_start_rate:.2%}"
    lines.append(f"  {'doomed starts':<{width}}  {doomed:>7}")
    if result.robots is not None:
        for side, counts in (("pursuers", result.robots.pursuers), ("evaders", result.robots.evaders)):
            total = sum(counts.values())
            share = ", ".join(
                f"{name.replace('_', ' ')} {count / total:.1%}" for name, count in counts.items() if count
            )
            lines.append(f"  {side:<{width}}  {total:>7,}  {share}")
    if result.arenas is not None:
        arenas, (low, high) = result.arenas, result.arenas.interval
        share = f"mean of {len(arenas.wins)}, 95 % interval {low:.2%} to {high:.2%}"
        lines.append(f"  {'pursuer, by arenas':<{width}}  {arenas.mean:>7.2%}  {share}")
        lines.append(f"  {'in the worst tenth':<{width}}  {arenas.worst:>7.2%}  in the worst of all {arenas.least:.0%}")
    return "\n".join(lines)


def tournament_table(tournament: "Tournament", starts: str) -> str:
    """Return the pursuers' win rates as a Markdown table, and below it the mixtures in equilibrium."""
    rates = tournament.win_rates
    header = ["pursuer \\ evader", *tournament.evaders, "mean"]
    rows = [
        [name, *[f"{rate:.1%}" for rate in [*row, row.mean()]]]
        for name, row in zip((*tournament.pursuers, "mean"), [*rates, rates.mean(axis=0)], strict=True)
    ]
    widths = [max(len(row[column]) for row in [header, *rows]) for column in range(len(header))]
    rule = ["-" * widths[0], *["-" * (width - 1) + ":" for width in widths[1:]]]
    lines = [
        "| " + " | ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]) + " |"
        for row in [header, rule, *rows]
    ]
    mixed = tournament.equilibrium
    sides = (("pursuers", tournament.pursuers, mixed.rows), ("evaders", tournament.evaders, mixed.columns))
    lines.append(
        f"\nStarts: {starts}. 95 % intervals are within {100 * tournament.widest_interval:.1f} points of the rates."
    )
    lines.append(f"In equilibrium the pursuer wins {mixed.value:.1%}:")
    for side, names, shares in sides:
        playing = sorted(zip(shares, names, strict=True), reverse=True)
        lines.append(f"  {side} " + ", ".join(f"{name} {share:.0%}" for share, name in playing if share >= 0.005))
    ratings = tournament.ratings
    lines.append("Elo, with 95 % intervals:")
    for side, names, points, reach in (
        ("pursuers", tournament.pursuers, ratings.pursuers, ratings.pursuer_reach),
        ("evaders", tournament.evaders, ratings.evaders, ratings.evader_reach),
    ):
        ranked = sorted(zip(points, reach, names, strict=True), reverse=True)
        lines.append(f"  {side} " + ", ".join(f"{name} {elo:.0f} ± {half:.0f}" for elo, half, name in ranked))
    return "\n".join(lines)


def varied_table(varied: "VariedMatches") -> str:
    """Return a sweep as lines of text: a row for each value of the first number, a column for each of the second."""
    first, *second = varied.variations
    corner = " \\ ".join(one.field for one in varied.variations)
    columns = [f"{value:g}" for value in second[0].values] if second else ["pursuer wins"]
    cells = [
        f"{100 * result.pursuer_win_rate:.1f} [{100 * low:.0f}, {100 * high:.0f}]"
        for result in varied.results
        for low, high in [result.pursuer_win_interval]
    ]
    rows = [
        [f"{value:g}", *cells[row * len(columns) : (row + 1) * len(columns)]] for row, value in enumerate(first.values)
    ]
    table = [[corner, *columns], *rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["  ".join(map(str.rjust, row, widths)) for row in table]
    return "\n".join([match_heading(varied.match), "the pursuer's wins in % of games, with 95 % intervals", *lines])


def card_table(agent: str, starts: str, card: "Card") -> str:
    """Return a regret card as lines of text."""
    won, lost, payoff = (
        f"{share} ({low} to {high})"
        for share, low, high in (
            (f"{card.won:.2%}", *(f"{end:.2%}" for end in card.won_interval)),
            (f"{card.lost:.2%}", *(f"{end:.2%}" for end in card.lost_interval)),
            (f"{card.payoff:+.3f}", *(f"{end:+.3f}" for end in card.payoff_interval)),
        )
    )
    lines = [
        f"{agent} ({card.role}) against the table: {card.games:,} games, starts: {starts}; 95 % intervals",
        f"  won {won}, lost {lost}, payoff {payoff}",
        f"  by the tables the value is {card.sure:+.3f} to {card.at_most:+.3f}: estimates, no bounds off their nodes",
        f"  gap to its own table's estimate {card.gap:.3f} ({card.gap_interval[0]:.3f} to {card.gap_interval[1]:.3f})",
    ]
    lines.append("  most is lost in these games (--record K writes them):")
    for game in card.worst:
        lines.append(f"    {game['game']:>6}  {game['outcome']} after {game['seconds']} s, gap {game['gap']:+.3f}")
    return "\n".join(lines)


def _shares(outcomes: dict[str, int]) -> str:
    games = max(1, sum(outcomes.values()))
    ranked = sorted(outcomes.items(), key=lambda item: -item[1])
    return " ".join(f"{name} {count / games:.1%}" for name, count in ranked if count) or "none finished"
