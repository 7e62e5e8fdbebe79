"""Table III: against the evader of self-play from scratch."""

from apollonius.experiments.claims import difference_claim
from apollonius.experiments.finding import Finding, as_data, beside_the_paper
from apollonius.experiments.study import Study

PAPER = {
    "P_random": {
        "captured": 115, "pursuer_hit_obstacle": 69, "evader_hit_obstacle": 66,
        "pursuer_out_of_range": 13, "evader_out_of_range": 36, "no_result": 201,
    },
    "P_curriculum": {
        "captured": 188, "pursuer_hit_obstacle": 62, "evader_hit_obstacle": 135,
        "pursuer_out_of_range": 22, "evader_out_of_range": 30, "no_result": 63,
    },
}  # fmt: skip
"""Games of 500."""


def run(study: Study) -> Finding:
    """Both pursuers against E_scratch."""
    results = {name: [study.match(name, "E_scratch", seed) for seed in study.seeds] for name in PAPER}
    rates = [
        (ours.pursuer_win_rate, theirs.pursuer_win_rate)
        for ours, theirs in zip(results["P_curriculum"], results["P_random"], strict=True)
    ]
    claim = difference_claim(
        "wins against E_scratch: P_curriculum minus P_random", "Table III", 0.706 - 0.434, 0.1, rates, study.games
    )
    text = beside_the_paper(results, PAPER)
    return Finding("Table III: against E_scratch", text, claims=(claim,), data=as_data(results))
