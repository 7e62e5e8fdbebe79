"""Fig. 6: agents of the curriculum against agents of self-play from scratch."""

from apollonius import MatchResult
from apollonius.evaluate.claims import Claim, rate_claim
from apollonius.reproduce.finding import Finding, outcome_shares, outcome_table, win_count
from apollonius.reproduce.study import Study
from apollonius.show import palette, style
from apollonius.show.curves import draw_bars


def run(study: Study) -> Finding:
    """Both cross-pairings: the pursuer's wins, and the evader's undefeated games."""
    chasing, fleeing = _pairings(study, 100)
    claims = make_claims(study)
    names = ["P_curriculum wins\nagainst E_scratch", "E_curriculum undefeated\nby P_scratch"]
    with style.picture(study.folder / "figure6.png") as (axes,):
        draw_bars(
            axes, names, [c.mean for c in claims], [c.interval for c in claims], [palette.PURSUER, palette.EVADER]
        )
        axes.axhline(70, color=palette.INK, linewidth=0.8, linestyle=":")
        axes.set_title("against agents from scratch (dotted: the paper's 70 %)")
    columns = [
        ("P_curriculum v E_scratch", outcome_shares(chasing)),
        ("P_scratch v E_curriculum", outcome_shares(fleeing)),
    ]
    data = {"chasing": [match.to_dict() for match in chasing], "fleeing": [match.to_dict() for match in fleeing]}
    text = outcome_table(columns)
    return Finding("Fig. 6: curriculum against scratch", text, ("figure6.png",), claims, data)


def make_claims(study: Study, percent: int = 100) -> tuple[Claim, ...]:
    """What the paper says of both pairings, at a percentage of self-play."""
    chasing, fleeing = _pairings(study, percent)
    undefeated = [(round(match.evader_undefeated_rate * match.games), match.games) for match in fleeing]
    return (
        rate_claim("P_curriculum beats E_scratch", "Fig. 6", 0.70, 0.70, [win_count(match) for match in chasing]),
        rate_claim("E_curriculum undefeated by P_scratch", "Fig. 6", 0.70, 0.70, undefeated),
    )


def _pairings(study: Study, percent: int) -> tuple[list[MatchResult], list[MatchResult]]:
    """The curriculum's pursuers against evaders from scratch, and its evaders against pursuers from scratch."""
    chasing = [study.match("P_curriculum", "E_scratch", seed, percent) for seed in study.seeds]
    return chasing, [study.match("P_scratch", "E_curriculum", seed, percent) for seed in study.seeds]
