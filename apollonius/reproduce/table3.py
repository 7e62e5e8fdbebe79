"""Table III: against the evader of self-play from scratch."""

from apollonius import MatchResult
from apollonius.evaluate.claims import Claim, difference_claim
from apollonius.evaluate.paper import TABLE_3
from apollonius.reproduce.finding import Finding, as_data, beside_the_paper
from apollonius.reproduce.study import Study


def run(study: Study) -> Finding:
    """Both pursuers against E_scratch."""
    results = _matches(study, 100)
    text = beside_the_paper(results, TABLE_3)
    return Finding("Table III: against E_scratch", text, claims=(make_claim(study),), data=as_data(results))


def make_claim(study: Study, percent: int = 100) -> Claim:
    """What the paper says of both, P_curriculum and E_scratch at a percentage of self-play."""
    results = _matches(study, percent)
    rates = [
        (ours.pursuer_win_rate, theirs.pursuer_win_rate)
        for ours, theirs in zip(results["P_curriculum"], results["P_random"], strict=True)
    ]
    return difference_claim(
        "wins against E_scratch: P_curriculum minus P_random", "Table III", 0.706 - 0.434, 0.1, rates, study.games
    )


def _matches(study: Study, percent: int) -> dict[str, list[MatchResult]]:
    return {name: [study.match(name, "E_scratch", seed, percent) for seed in study.seeds] for name in TABLE_3}
