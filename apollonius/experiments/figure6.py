"""Fig. 6: agents of the curriculum against agents of self-play from scratch."""

from apollonius.experiments.claims import rate_claim
from apollonius.experiments.finding import Finding, mean_shares, outcome_table, win_count
from apollonius.experiments.study import Study
from apollonius.show import palette, style
from apollonius.show.curves import draw_bars


def run(study: Study) -> Finding:
    """Both cross-pairings: the pursuer's wins, and the evader's undefeated games."""
    chasing = [study.match("P_curriculum", "E_scratch", seed) for seed in study.seeds]
    fleeing = [study.match("P_scratch", "E_curriculum", seed) for seed in study.seeds]
    undefeated = [(round(match.evader_undefeated_rate * match.games), match.games) for match in fleeing]
    claims = (
        rate_claim("P_curriculum beats E_scratch", "Fig. 6", 0.70, 0.70, [win_count(match) for match in chasing]),
        rate_claim("E_curriculum undefeated by P_scratch", "Fig. 6", 0.70, 0.70, undefeated),
    )
    names = ["P_curriculum wins\nagainst E_scratch", "E_curriculum undefeated\nby P_scratch"]
    with style.picture(study.folder / "figure6.png") as (axes,):
        draw_bars(
            axes, names, [c.mean for c in claims], [c.interval for c in claims], [palette.PURSUER, palette.EVADER]
        )
        axes.axhline(70, color=palette.INK, linewidth=0.8, linestyle=":")
        axes.set_title("against agents from scratch (dotted: the paper's 70 %)")
    columns = [
        ("P_curriculum v E_scratch", mean_shares(chasing)),
        ("P_scratch v E_curriculum", mean_shares(fleeing)),
    ]
    data = {"chasing": [match.to_dict() for match in chasing], "fleeing": [match.to_dict() for match in fleeing]}
    text = outcome_table(columns)
    return Finding("Fig. 6: curriculum against scratch", text, ("figure6.png",), claims, data)
