"""What our best pursuer is held to beyond the paper: one agent, all at once."""

from apollonius.evaluate.match import MatchResult
from apollonius.experiments.claims import rate_claim
from apollonius.experiments.finding import Finding, win_count
from apollonius.experiments.study import Study


def run(study: Study) -> Finding:
    """P_curriculum against E_scratch and random: wins, direct captures, games lost by its own fault."""
    trained = [study.match("P_curriculum", "E_scratch", seed) for seed in study.seeds]
    random = [study.match("P_curriculum", "random", seed) for seed in study.seeds]
    captures = [(match.outcomes["captured"], match.games) for match in random]
    source = "beyond"
    claims = (
        rate_claim("wins against E_scratch", source, 0.706, 0.85, [win_count(match) for match in trained]),
        rate_claim("wins against random", source, 0.93, 0.93, [win_count(match) for match in random]),
        rate_claim("direct captures of random", source, 0.12, 0.67, captures),
        rate_claim("own failures against random", source, 0.07, 0.01, [_own_failures(m) for m in random], at_most=True),
        rate_claim("own failures against E_scratch", source, 0.17, 0.01, [_own_failures(m) for m in trained], True),
    )
    text = "P_curriculum of each seed; own failures are its crashes and exits, both robots failing included."
    return Finding("Beyond the paper", text, claims=claims)


def _own_failures(match: MatchResult) -> tuple[int, int]:
    failures = ("pursuer_hit_obstacle", "pursuer_out_of_range", "both_failed")
    return sum(match.outcomes[name] for name in failures), match.games
