"""What our pursuer is held to beyond the paper: one agent, all at once."""

from apollonius import MatchResult
from apollonius.evaluate.claims import rate_claim
from apollonius.reproduce.finding import Finding, as_data, beside_the_paper, win_count
from apollonius.reproduce.study import Study

PURSUER = "shielded:P_curriculum"


def run(study: Study) -> Finding:
    """P_curriculum behind a shield against random and E_scratch: wins, direct captures, games lost by its own fault."""
    random = [study.match(PURSUER, "random", seed) for seed in study.seeds]
    trained = [study.match(PURSUER, "E_scratch", seed) for seed in study.seeds]
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
    """Games in which the pursuer failed, both robots at once included, and all games, of each match."""
    failures = ("pursuer_hit_obstacle", "pursuer_out_of_range", "both_failed")
    return [(sum(match.outcomes[name] for name in failures), match.games) for match in matches]
