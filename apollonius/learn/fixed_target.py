"""Stage 1, Algorithm 1: the pursuer learns against an evader that does not learn, in the paper one that stays."""

import jax
from jaxtyping import PRNGKeyArray

from apollonius.agents.policy import Pool
from apollonius.game.game import Game
from apollonius.learn import dqn
from apollonius.learn.stage import Plan, TrainState, start


def start_fixed_target(plan: Plan, game: Game, key: PRNGKeyArray, evader: Pool) -> TrainState:
    """The state before the first step: a pursuer with random weights. The key is consumed."""
    network_key, stage_key = jax.random.split(key)
    return start(plan, game, stage_key, dqn.init(plan.dqn, network_key), evader)
