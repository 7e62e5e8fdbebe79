"""Stage 1, Algorithm 1: the pursuer learns to reach an evader that stays where it is."""

import jax
from jaxtyping import PRNGKeyArray

from apollonius.agents.classical import Still
from apollonius.agents.policy import Pool, solo
from apollonius.game.game import Game
from apollonius.learn import dqn
from apollonius.learn.stage import Plan, TrainState, start


def stationary_evader() -> Pool:
    """The evader of stage 1."""
    return solo(Still())


def start_fixed_target(plan: Plan, game: Game, key: PRNGKeyArray) -> TrainState:
    """The state before the first step: a pursuer with random weights. The key is consumed."""
    network_key, stage_key = jax.random.split(key)
    return start(plan, game, stage_key, dqn.init(plan.dqn, network_key), stationary_evader())
