"""Fig. 4: success rate and average reward in stage 1, over episodes."""

from apollonius.evaluate.claims import rate_claim
from apollonius.evaluate.paper import STAGE_1
from apollonius.reproduce.finding import Finding, win_count
from apollonius.reproduce.study import Study
from apollonius.show import palette, style
from apollonius.show.curves import Curve, draw_seeds, smooth

_WINDOW = 50
"""Chunks over which the reward is averaged."""


def run(study: Study) -> Finding:
    """Greedy success in a fixed set of games, and the reward of the exploring pursuer."""
    successes, rewards = [], []
    for seed in study.seeds:
        evaluations = study.evaluations("curriculum", seed, "fixed-target")
        games = sum(evaluations[0].outcomes.values())
        successes.append(
            (
                [evaluation.episodes for evaluation in evaluations],
                [100 * evaluation.outcomes["captured"] / games for evaluation in evaluations],
            )
        )
        rewards.append(reward_curve(study, "curriculum", seed, "fixed-target"))
    with style.picture(study.folder / "figure4.png", columns=2) as (left, right):
        draw_seeds(left, successes, palette.PURSUER, "greedy")
        left.axhline(100 * STAGE_1, color=palette.INK, linewidth=0.8, ls=":", label="the paper, 200,000 episodes")
        left.set(title="success rate in stage 1", xlabel="episodes", ylabel="captured [%]", ylim=(0, 102))
        left.legend(loc="lower right")
        draw_seeds(right, rewards, palette.PURSUER, "exploring")
        right.set(title="average reward of an episode", xlabel="episodes", ylabel="reward")
        right.legend(loc="lower right")
    matches = [study.match("P_stage1", "still", seed) for seed in study.seeds]
    claim = rate_claim("stage 1: success", "section IV, Fig. 4", STAGE_1, STAGE_1, [win_count(m) for m in matches])
    episodes = ", ".join(f"{x[-1]:,}" for x, _ in successes)
    text = f"Left: greedy games from fixed starts. Right: the games of training. Episodes in all, by seed: {episodes}."
    data = {"success": successes, "matches": [match.to_dict() for match in matches]}
    return Finding("Fig. 4: stage 1", text, ("figure4.png",), (claim,), data)


def reward_curve(study: Study, name: str, seed: int, stage: str) -> Curve:
    """Episodes of a stage, and the running mean of the exploring pursuer's reward in an episode."""
    played = [line for line in study.metrics(name, seed, stage) if line.games]
    return [line.episodes for line in played], smooth([line.pursuer_return for line in played], _WINDOW)
