"""The findings of figures and tables: words, pictures, numbers and verdicts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
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
"""By outcome, its share of the games with each training of the pursuer."""


def outcome_table(columns: Sequence[tuple[str, Shares]]) -> str:
    """Return mean shares of outcomes as a Markdown table in the paper's order, with half of their
    95 % intervals.
    """
    rows = [
        [
            outcome.replace("_", " "),
            *(mean_with_interval(shares.get(outcome, [])) for _, shares in columns),
        ]
        for outcome in columns[0][1]
    ]
    return markdown_table(["", *(name for name, _ in columns)], rows)


def mean_with_interval(shares: Sequence[float]) -> str:
    """Return a mean over seeds with half of its 95 % interval's width (Student's t); "-" without
    values.
    """
    if not shares:
        return "-"
    percents = [100 * share for share in shares]
    low, high = mean_interval(percents)
    return f"{np.mean(percents):.1f}" + (
        f" ± {(high - low) / 2:.1f}%" if len(percents) > 1 else "%"
    )


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows))


Matches = list[list[MatchResult]]
"""Matches as `Study.matches` returns them: a row for each training of the pursuer."""
Rates = tuple[tuple[float, ...], ...]
"""A value of each of such matches."""


won = attrgetter("pursuer_win_rate")
"""Share of a match's games that the pursuer won."""
undefeated = attrgetter("evader_undefeated_rate")
"""Share of a match's games in which the evader was not beaten."""


def rates(matches: Matches, share: Callable[[MatchResult], float]) -> Rates:
    """Return a share of the games of each match."""
    return tuple(tuple(share(match) for match in row) for row in matches)


def differences(first: Rates, second: Rates) -> Rates:
    """Return the difference of each value of the first to that of the second."""
    return tuple(map(tuple, np.subtract(first, second).tolist()))


def outcome_shares(matches: Matches) -> Shares:
    """Return the share of each outcome with each training of the pursuer, over those of the
    evader.
    """
    return {
        outcome: [
            float(np.mean([match.outcomes[outcome] / match.games for match in row]))
            for row in matches
        ]
        for outcome in matches[0][0].outcomes
    }


def beside_the_paper(results: dict[str, Matches], paper: dict[str, dict[str, int]]) -> str:
    """Return the shares of outcomes here and in the paper as a Markdown table."""
    columns = [(name, outcome_shares(matches)) for name, matches in results.items()]
    for name, counts in paper.items():
        games = sum(counts.values())
        columns.append(
            (f"{name}, paper", {outcome: [count / games] for outcome, count in counts.items()})
        )
    return outcome_table(columns)


def results_data(results: dict[str, Matches]) -> dict[str, list[list[dict[str, Any]]]]:
    return {
        name: [[match.to_dict() for match in row] for row in matches]
        for name, matches in results.items()
    }


def write_report(study: Study, findings: Sequence[Finding]) -> None:
    """Write both files into the study's folder, atomically."""
    claims = [claim for finding in findings for claim in finding.claims]
    is_full = study.budget == FULL_BUDGET
    results = {
        "budget": study.budget,
        "seeds": list(study.seeds),
        "games": study.games,
        "claims": [claim.to_dict(is_full) for claim in claims],
        "findings": {
            finding.title: {
                "text": finding.text,
                "pictures": finding.pictures,
                "data": finding.data,
            }
            for finding in findings
        },
    }
    sections = [
        "# The paper's evaluation, again",
        f"Budget `{study.budget}`, seeds {', '.join(map(str, study.seeds))}, "
        f"{study.games:,} games in a match, all on the same starts, every training of the "
        "pursuer against every one of the evader. Intervals are 95 % prediction intervals of "
        "another pair of trainings, the chance that of its reaching the bound (Student's t). A "
        "verdict "
        f"takes {FEWEST_SEEDS} seeds of the budget `{FULL_BUDGET}`.",
        claim_table(claims, is_full),
    ]
    for finding in findings:
        pictures = [f"![{finding.title}]({picture})" for picture in finding.pictures]
        sections += [f"## {finding.title}", finding.text, *pictures]
    write_atomically(study.folder / "results.json", to_json(results, indent=1).encode())
    write_atomically(study.folder / "report.md", ("\n\n".join(sections) + "\n").encode())


_MOST_LISTED = 9
"""Values of a claim that its row lists one by one; of more it has the least and the largest."""


def claim_table(claims: Sequence[Claim], is_full: bool) -> str:
    """Return all claims with the paper's value, ours, the prediction and the verdict as a Markdown
    table.
    """
    head = [
        "claim",
        "source",
        "paper",
        "to reach",
        "here",
        "95 % prediction",
        "chance",
        "by training",
        "verdict",
    ]
    rows: list[list[str]] = []
    for claim in claims:
        prediction = claim.prediction
        chance = prediction.chance(claim.bound)
        numbers = [f"{rate:.1%}" for rate in (claim.paper, claim.bound, prediction.mean)]
        prediction_cells = [
            "{:.1%} to {:.1%}".format(*prediction.interval),
            "-" if chance is None else f"{chance:.0%}",
        ]
        values = np.array(claim.values)
        trainings = f"{values.min():.1%} to {values.max():.1%}"
        if values.size <= _MOST_LISTED:
            trainings = "; ".join(
                ", ".join(f"{value:.1%}" for value in row) for row in claim.values
            )
        rows.append(
            [
                claim.name,
                claim.source,
                *numbers,
                *prediction_cells,
                trainings,
                claim.verdict(is_full),
            ]
        )
    return markdown_table(head, rows)
