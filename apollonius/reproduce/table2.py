"""Table II: against the random evader."""

from apollonius import MatchResult
from apollonius.evaluate.claims import Claim, difference_claim, rate_claim
from apollonius.evaluate.paper import TABLE_2
from apollonius.reproduce.finding import Finding, as_data, beside_the_paper, win_count
from apollonius.reproduce.study import Study


def run(study: Study) -> Finding:
    """Both pursuers against the random evader: wins, and how many of them by capture."""
    results = _matches(study, 100)
    text = beside_the_paper(results, TABLE_2)
    return Finding("Table II: against the random evader", text, claims=make_claims(study), data=as_data(results))


def make_claims(study: Study, percent: int = 100) -> tuple[Claim, ...]:
    """What the paper says of both, P_curriculum at a percentage of self-play."""
    results = _matches(study, percent)
    captures = {
        name: [result.outcomes["captured"] / result.games for result in matches] for name, matches in results.items()
    }
    wins = {name: [win_count(result) for result in matches] for name, matches in results.items()}
    return (
        rate_claim("P_curriculum beats random", "Table II", 0.93, 0.93, wins["P_curriculum"]),
        rate_claim("P_random beats random", "Table II", 0.91, 0.91, wins["P_random"]),
        difference_claim(
            "direct captures of random: P_random minus P_curriculum", "Table II", (336 - 62) / 500, 0.2,
            list(zip(captures["P_random"], captures["P_curriculum"], strict=True)), study.games,
        ),
    )  # fmt: skip


def _matches(study: Study, percent: int) -> dict[str, list[MatchResult]]:
    return {name: [study.match(name, "random", seed, percent) for seed in study.seeds] for name in TABLE_2}
