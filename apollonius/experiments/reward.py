"""The pursuer's average reward in the course of a training."""

from apollonius.experiments.study import Study
from apollonius.show.curves import Curve, smooth

_WINDOW = 50
"""Chunks over which the reward is averaged."""


def reward_curve(study: Study, name: str, seed: int, stage: str) -> Curve:
    """Episodes of a stage, and the running mean of the exploring pursuer's reward in an episode."""
    played = [line for line in study.metrics(name, seed, stage) if sum(line["outcomes"].values())]
    return [line["episodes"] for line in played], smooth([line["pursuer_return"] for line in played], _WINDOW)
