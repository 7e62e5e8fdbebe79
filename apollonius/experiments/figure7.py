"""Fig. 7: average reward in training, curriculum against one-sided training on a random evader."""

from apollonius.experiments.finding import Finding
from apollonius.experiments.study import Study
from apollonius.show import style
from apollonius.show.curves import Curve, draw_seeds, smooth

_WINDOW = 50
"""Chunks over which the reward is averaged."""


def run(study: Study) -> Finding:
    """The pursuer's reward over all episodes: stage 1 and then self-play, against the random evader throughout."""
    curriculum = [_reward(study, seed, "curriculum", ("fixed-target", "self-play")) for seed in study.seeds]
    random = [_reward(study, seed, "random", ("fixed-target",)) for seed in study.seeds]
    with style.picture(study.folder / "figure7.png", width=6.0) as (axes,):
        draw_seeds(axes, curriculum, style.PURSUER, "curriculum")
        draw_seeds(axes, random, style.OTHER, "trained on a random evader")
        axes.set(title="average reward of the pursuer in training", xlabel="episodes", ylabel="reward of an episode")
        axes.legend()
    text = (
        "Exploring players, as in training. Self-play weighs progress with another c than stage 1 and than training "
        "on a random evader, so the level changes where it begins."
    )
    return Finding("Fig. 7: average reward", text, ("figure7.png",))


def _reward(study: Study, seed: int, name: str, stages: tuple[str, ...]) -> Curve:
    episodes: list[float | int] = []
    rewards: list[float | int] = []
    for stage in stages:
        played = [line for line in study.metrics(name, seed, stage) if sum(line["outcomes"].values())]
        before = episodes[-1] if episodes else 0
        episodes += [before + line["episodes"] for line in played]
        rewards += smooth([line["pursuer_return"] for line in played], _WINDOW)
    return episodes, rewards
