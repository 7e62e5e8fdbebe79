"""The report of a study: `report.md` for people, `results.json` for programs."""

from collections.abc import Sequence

from apollonius.document import to_json, write_atomically
from apollonius.evaluate.claims import FEWEST_SEEDS, FULL_BUDGET, Claim
from apollonius.reproduce.finding import Finding, as_markdown, percent
from apollonius.reproduce.study import Study
from apollonius.show.markdown import markdown_table


def write_report(study: Study, findings: Sequence[Finding]) -> None:
    """Write both files into the study's folder, atomically."""
    claims = [claim for finding in findings for claim in finding.claims]
    results = {
        "budget": study.budget,
        "seeds": list(study.seeds),
        "games": study.games,
        "intervals": _intervals(study),
        "claims": [claim.to_dict(study.is_full) for claim in claims],
        "findings": {
            finding.title: {"text": finding.text, "pictures": finding.pictures, "data": finding.data}
            for finding in findings
        },
    }
    sections = [
        "# The paper's evaluation, again",
        f"Budget `{study.budget}`, seeds {', '.join(map(str, study.seeds))}, {study.games:,} games in a match, all on "
        f"the same starts. Intervals are 95 %, {_intervals(study)}. A verdict takes {FEWEST_SEEDS} "
        f"seeds of the budget `{FULL_BUDGET}`.",
        claim_table(claims, study.is_full),
        *[as_markdown(finding) for finding in findings],
    ]
    write_atomically(study.folder / "results.json", to_json(results, indent=1).encode())
    write_atomically(study.folder / "report.md", ("\n\n".join(sections) + "\n").encode())


def _intervals(study: Study) -> str:
    """What the intervals of the claims are of."""
    if len(study.seeds) == 1:
        return "of the games of the one seed"
    return "of the mean over seeds (Student's t, and never narrower than that of all their games)"


def claim_table(claims: Sequence[Claim], is_full: bool) -> str:
    """All claims with the paper's value, ours, its interval and the verdict, as a Markdown table."""
    head = ["claim", "source", "paper", "to reach", "here", "95 % interval", "by seed", "verdict"]
    return markdown_table(head, [[*_claim_row(claim), claim.verdict(is_full)] for claim in claims])


def _claim_row(claim: Claim) -> list[str]:
    low, high = claim.interval
    return [
        claim.name,
        claim.source,
        percent(claim.paper),
        f"at {'most' if claim.at_most else 'least'} {percent(claim.bound)}",
        percent(claim.mean),
        f"{percent(low)} to {percent(high)}",
        ", ".join(percent(value) for value, _ in claim.seeds),
    ]
