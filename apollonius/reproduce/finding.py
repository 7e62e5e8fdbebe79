"""The findings of figures and tables: words, pictures, numbers and verdicts."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from apollonius import MatchResult
from apollonius.evaluate.claims import FEWEST_SEEDS, FULL_BUDGET, Claim
from apollonius.evaluate.statistics import mean_interval
from apollonius.io.document import to_json, write_atomically
from apollonius.reproduce.study import Study


@dataclass(frozen=True)
class Finding:
    """One section of a report."""

    title: str
    text: str
    """Markdown, without heading and pictures."""
    pictures: tuple[str, ...] = ()
    """File names in the folder of the study."""
    claims: tuple[Claim, ...] = ()
    data: dict[str, Any] = field(default_factory=dict)
    """The numbers behind it, besides the claims, as JSON-like data."""


Shares = dict[str, list[float]]
"""By outcome, its share of the games in the matches of each seed."""


def outcome_table(columns: Sequence[tuple[str, Shares]]) -> str:
    """Return mean shares of outcomes as a Markdown table in the paper's order, with half of their 95 % intervals."""
    rows = [
        [outcome.replace("_", " "), *(mean_share(shares.get(outcome, [])) for _, shares in columns)]
        for outcome in columns[0][1]
    ]
    return markdown_table(["", *(name for name, _ in columns)], rows)


def mean_share(shares: Sequence[float]) -> str:
    """Return a mean over seeds with half of its 95 % interval's width (Student's t); "-" without values."""
    if not shares:
        return "-"
    percents = [100 * share for share in shares]
    low, high = mean_interval(percents)
    return f"{np.mean(percents):.1f}" + (f" ± {(high - low) / 2:.1f}%" if len(percents) > 1 else "%")


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows))


def outcome_shares(results: Sequence[MatchResult]) -> Shares:
    """Return the share of each outcome in the matches of several seeds."""
    return {outcome: [result.outcomes[outcome] / result.games for result in results] for outcome in results[0].outcomes}


def beside_the_paper(results: dict[str, list[MatchResult]], paper: dict[str, dict[str, int]]) -> str:
    """Return the shares of outcomes here and in the paper as a Markdown table."""
    columns = [(name, outcome_shares(matches)) for name, matches in results.items()]
    for name, counts in paper.items():
        games = sum(counts.values())
        columns.append((f"{name}, paper", {outcome: [count / games] for outcome, count in counts.items()}))
    return outcome_table(columns)


def as_data(results: dict[str, list[MatchResult]]) -> dict[str, list[dict[str, Any]]]:
    return {name: [match.to_dict() for match in matches] for name, matches in results.items()}


def win_count(result: MatchResult) -> tuple[int, int]:
    return round(result.pursuer_win_rate * result.games), result.games


def write_report(study: Study, findings: Sequence[Finding]) -> None:
    """Write both files into the study's folder, atomically."""
    claims = [claim for finding in findings for claim in finding.claims]
    intervals = "of the mean over seeds (Student's t)" if len(study.seeds) > 1 else "of the games of the one seed"
    results = {
        "budget": study.budget,
        "seeds": list(study.seeds),
        "games": study.games,
        "intervals": intervals,
        "claims": [claim.to_dict(study.is_full) for claim in claims],
        "findings": {
            finding.title: {"text": finding.text, "pictures": finding.pictures, "data": finding.data}
            for finding in findings
        },
    }
    sections = [
        "# The paper's evaluation, again",
        f"Budget `{study.budget}`, seeds {', '.join(map(str, study.seeds))}, {study.games:,} games in a match, all on "
        f"the same starts. Intervals are 95 %, {intervals}. A verdict takes {FEWEST_SEEDS} "
        f"seeds of the budget `{FULL_BUDGET}`.",
        claim_table(claims, study.is_full),
    ]
    for finding in findings:
        pictures = [f"![{finding.title}]({picture})" for picture in finding.pictures]
        sections += [f"## {finding.title}", finding.text, *pictures]
    write_atomically(study.folder / "results.json", to_json(results, indent=1).encode())
    write_atomically(study.folder / "report.md", ("\n\n".join(sections) + "\n").encode())


def claim_table(claims: Sequence[Claim], is_full: bool) -> str:
    """Return all claims with the paper's value, ours, its interval and the verdict as a Markdown table."""
    rows = [["claim", "source", "paper", "to reach", "here", "95 % interval", "by seed", "verdict"]]
    for claim in claims:
        numbers = [f"{rate:.1%}" for rate in (claim.paper, claim.bound, claim.mean)]
        interval, seeds = "{:.1%} to {:.1%}".format(*claim.interval), ", ".join(f"{one:.1%}" for one in claim.seeds)
        rows.append([claim.name, claim.source, *numbers, interval, seeds, claim.verdict(is_full)])
    return markdown_table(rows[0], rows[1:])
