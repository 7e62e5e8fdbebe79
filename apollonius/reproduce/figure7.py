"""Fig. 7: average reward in training, curriculum against one-sided training on a random evader."""

from apollonius.reproduce.figure4 import reward_curve
from apollonius.reproduce.finding import Finding
from apollonius.reproduce.study import Study
from apollonius.show import palette, style
from apollonius.show.curves import Curve, draw_seeds


def run(study: Study) -> Finding:
    """The pursuer's reward over all episodes: stage 1 and then self-play, against the random evader throughout."""
    curriculum = [_curriculum(study, seed) for seed in study.seeds]
    random = [reward_curve(study, "random", seed, "fixed-target") for seed in study.seeds]
    with style.picture(study.folder / "figure7.png", width=6.0) as (axes,):
        draw_seeds(axes, curriculum, palette.PURSUER, "curriculum")
        draw_seeds(axes, random, palette.OTHER, "trained on a random evader")
        axes.set(title="average reward of the pursuer in training", xlabel="episodes", ylabel="reward of an episode")
        axes.legend()
    text = (
        "Exploring players, as in training. Self-play weighs progress with another c than stage 1 and than training "
        "on a random evader, so the level changes where it begins. It begins after different numbers of episodes with "
        "different seeds, and there their band is widest."
    )
    return Finding("Fig. 7: average reward", text, ("figure7.png",))


def _curriculum(study: Study, seed: int) -> Curve:
    """Self-play's episodes are counted on from those of stage 1."""
    episodes, rewards = reward_curve(study, "curriculum", seed, "fixed-target")
    later, more = reward_curve(study, "curriculum", seed, "self-play")
    return [*episodes, *(episodes[-1] + episode for episode in later)], [*rewards, *more]
