"""What a figure, a table or a study finds: words, pictures, numbers and verdicts."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from apollonius import MatchResult
from apollonius.document import to_json, write_atomically
from apollonius.evaluate.claims import Claim
from apollonius.show.markdown import markdown_table, mean_over_seeds


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


def write_finding(finding: Finding, folder: Path, name: str) -> None:
    """Write one finding into a folder, as `NAME.md` and `NAME.json`, atomically."""
    write_atomically(folder / f"{name}.json", to_json(finding.data, indent=1).encode())
    write_atomically(folder / f"{name}.md", f"{as_markdown(finding)}\n".encode())


def as_markdown(finding: Finding) -> str:
    """A finding under its title, with its pictures."""
    pictures = "".join(f"\n\n![{finding.title}]({picture})" for picture in finding.pictures)
    return f"## {finding.title}\n\n{finding.text}{pictures}"


def percent(rate: float) -> str:
    """A rate as the reports print it."""
    return f"{rate:.1%}"


Shares = dict[str, list[float]]
"""By outcome, its share of the games in the matches of each seed."""


def outcome_table(columns: Sequence[tuple[str, Shares]]) -> str:
    """Shares of outcomes as a Markdown table, a column each, in the order of the paper's tables: means over seeds and,
    where there are several, how far the 95 % interval reaches.
    """
    rows = [
        [outcome.replace("_", " "), *(mean_share(shares.get(outcome, [])) for _, shares in columns)]
        for outcome in columns[0][1]
    ]
    return markdown_table(["", *(name for name, _ in columns)], rows)


def mean_share(shares: Sequence[float]) -> str:
    """A mean over seeds as the reports print it; "-" of nothing."""
    return mean_over_seeds([100 * share for share in shares], "{:.1f}") + "%" if shares else "-"


def outcome_shares(results: Sequence[MatchResult]) -> Shares:
    """Share of each outcome in the matches of several seeds."""
    return {outcome: [result.outcomes[outcome] / result.games for result in results] for outcome in results[0].outcomes}


def beside_the_paper(results: dict[str, list[MatchResult]], paper: dict[str, dict[str, int]]) -> str:
    """Shares of outcomes here, over seeds, and the paper's from its counts, as a Markdown table."""
    columns = [(name, outcome_shares(matches)) for name, matches in results.items()]
    for name, counts in paper.items():
        games = sum(counts.values())
        columns.append((f"{name}, paper", {outcome: [count / games] for outcome, count in counts.items()}))
    return outcome_table(columns)


def as_data(results: dict[str, list[MatchResult]]) -> dict[str, list[dict[str, Any]]]:
    """Matches by name as JSON-like data."""
    return {name: [match.to_dict() for match in matches] for name, matches in results.items()}


def win_count(result: MatchResult) -> tuple[int, int]:
    """The pursuer's wins, and the games."""
    return round(result.pursuer_win_rate * result.games), result.games
