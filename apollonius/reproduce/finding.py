"""What a figure, a table or a study finds: words, pictures, numbers and verdicts."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from apollonius import MatchResult
from apollonius.document import write_atomically
from apollonius.reproduce.claims import Claim
from apollonius.show.markdown import markdown_table


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
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / f"{name}.json", json.dumps(finding.data, indent=1).encode())
    write_atomically(folder / f"{name}.md", f"{as_markdown(finding)}\n".encode())


def as_markdown(finding: Finding) -> str:
    """A finding under its title, with its pictures."""
    pictures = "".join(f"\n\n![{finding.title}]({picture})" for picture in finding.pictures)
    return f"## {finding.title}\n\n{finding.text}{pictures}"


def percent(rate: float) -> str:
    """A rate as the reports print it."""
    return f"{rate:.1%}"


def outcome_table(columns: Sequence[tuple[str, dict[str, float]]]) -> str:
    """Shares of outcomes as a Markdown table, a column each, in the order of the paper's tables."""
    rows = [
        [outcome.replace("_", " "), *(percent(shares[outcome]) if outcome in shares else "-" for _, shares in columns)]
        for outcome in columns[0][1]
    ]
    return markdown_table(["", *(name for name, _ in columns)], rows)


def mean_shares(results: Sequence[MatchResult]) -> dict[str, float]:
    """Share of each outcome, averaged over the matches of several seeds."""
    return {
        outcome: sum(result.outcomes[outcome] / result.games for result in results) / len(results)
        for outcome in results[0].outcomes
    }


def beside_the_paper(results: dict[str, list[MatchResult]], paper: dict[str, dict[str, int]]) -> str:
    """Shares of outcomes here, averaged over seeds, and the paper's from its counts, as a Markdown table."""
    columns = [(name, mean_shares(matches)) for name, matches in results.items()]
    for name, counts in paper.items():
        columns.append((f"{name}, paper", {outcome: count / sum(counts.values()) for outcome, count in counts.items()}))
    return outcome_table(columns)


def as_data(results: dict[str, list[MatchResult]]) -> dict[str, list[dict[str, Any]]]:
    """Matches by name as JSON-like data."""
    return {name: [match.to_dict() for match in matches] for name, matches in results.items()}


def win_count(result: MatchResult) -> tuple[int, int]:
    """The pursuer's wins, and the games."""
    return round(result.pursuer_win_rate * result.games), result.games
