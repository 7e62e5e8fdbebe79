"""What the paper reports: outcomes of its matches, to stand beside ours."""

STAGE_1 = 0.96
"""Share of games captured against an evader that stays, after 200,000 episodes (section IV, Fig. 4)."""

TABLE_2 = {
    "P_random": {
        "captured": 336, "pursuer_hit_obstacle": 28, "evader_hit_obstacle": 26,
        "pursuer_out_of_range": 17, "evader_out_of_range": 93, "no_result": 0,
    },
    "P_curriculum": {
        "captured": 62, "pursuer_hit_obstacle": 15, "evader_hit_obstacle": 52,
        "pursuer_out_of_range": 19, "evader_out_of_range": 351, "no_result": 1,
    },
}  # fmt: skip
"""Games of 500 against the random evader, by pursuer."""

TABLE_3 = {
    "P_random": {
        "captured": 115, "pursuer_hit_obstacle": 69, "evader_hit_obstacle": 66,
        "pursuer_out_of_range": 13, "evader_out_of_range": 36, "no_result": 201,
    },
    "P_curriculum": {
        "captured": 188, "pursuer_hit_obstacle": 62, "evader_hit_obstacle": 135,
        "pursuer_out_of_range": 22, "evader_out_of_range": 30, "no_result": 63,
    },
}  # fmt: skip
"""Games of 500 against the evader of self-play from scratch, by pursuer."""


def paper_shares(pursuer: str, evader: str) -> dict[str, float]:
    """The paper's shares of outcomes for a pairing, in [0, 1]; of those that it does not report, nothing."""
    if (pursuer, evader) == ("P_stage1", "still"):
        return {"captured": STAGE_1}
    counts = {"random": TABLE_2, "E_scratch": TABLE_3}.get(evader, {}).get(pursuer, {})
    return {outcome: count / sum(counts.values()) for outcome, count in counts.items()}
