"""The paper's Tables II and III, and what our pursuer is held to beyond the paper."""

from apollonius import MatchResult
from apollonius.evaluate.claims import TABLE_2, TABLE_3, Claim, difference_claim, rate_claim
from apollonius.reproduce.finding import Finding, as_data, beside_the_paper, win_count
from apollonius.reproduce.study import Study

SHIELDED_PURSUER = "shielded:P_curriculum"


def table_2(study: Study) -> Finding:
    """Play both pursuers against the random evader: wins, and how many of them by capture."""
    results = {name: study.matches(name, "random") for name in TABLE_2}
    text, claims = beside_the_paper(results, TABLE_2), table_2_claims(study)
    return Finding("Table II: against the random evader", text, claims=claims, data=as_data(results))


def table_2_claims(study: Study, percent: int = 100) -> tuple[Claim, ...]:
    """Return what the paper says of both, P_curriculum at a percentage of self-play."""
    results = {name: study.matches(name, "random", percent) for name in TABLE_2}
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


def table_3(study: Study) -> Finding:
    """Play both pursuers against the evader of self-play from scratch."""
    results = {name: study.matches(name, "E_scratch") for name in TABLE_3}
    text, claims = beside_the_paper(results, TABLE_3), (table_3_claim(study),)
    return Finding("Table III: against E_scratch", text, claims=claims, data=as_data(results))


def table_3_claim(study: Study, percent: int = 100) -> Claim:
    """Return what the paper says of both, P_curriculum and E_scratch at a percentage of self-play."""
    ours, theirs = (study.matches(name, "E_scratch", percent) for name in ("P_curriculum", "P_random"))
    rates = [(one.pursuer_win_rate, other.pursuer_win_rate) for one, other in zip(ours, theirs, strict=True)]
    return difference_claim(
        "wins against E_scratch: P_curriculum minus P_random", "Table III", 0.706 - 0.434, 0.1, rates, study.games
    )


def beyond(study: Study) -> Finding:
    """Play P_curriculum behind a shield: wins, direct captures, games lost by its own fault, one agent all at once."""
    random, trained = (study.matches(SHIELDED_PURSUER, evader) for evader in ("random", "E_scratch"))
    captures = [(match.outcomes["captured"], match.games) for match in random]
    source = "beyond"
    claims = (
        rate_claim("shielded: wins against random", source, 0.93, 0.93, [win_count(match) for match in random]),
        rate_claim("shielded: direct captures of random", source, 0.12, 0.67, captures),
        rate_claim("shielded: own failures against random", source, 0.07, 0.01, own_failures(random), at_most=True),
        rate_claim("shielded: wins against E_scratch", source, 0.706, 0.85, [win_count(match) for match in trained]),
        rate_claim("shielded: own failures against E_scratch", source, 0.17, 0.01, own_failures(trained), at_most=True),
    )
    results = {"against random": random, "against E_scratch": trained}
    text = "P_curriculum of each seed behind a shield. Own failures are its crashes and exits.\n\n"
    return Finding("Beyond the paper", text + beside_the_paper(results, {}), claims=claims, data=as_data(results))


def own_failures(matches: list[MatchResult]) -> list[tuple[int, int]]:
    """Return in how many games the pursuer failed, both robots at once included, and how many there were."""
    failures = ("pursuer_hit_obstacle", "pursuer_out_of_range", "both_failed")
    return [(sum(match.outcomes[name] for name in failures), match.games) for match in matches]
