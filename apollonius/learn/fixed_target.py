"""Stage 1, Algorithm 1: the pursuer learns against an evader that does not learn, in the paper one that stays."""

import jax
from jaxtyping import PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.pool import Pool
from apollonius.game.game import Game
from apollonius.learn.state import Plan, TrainState, first_learner, start


def start_fixed_target(
    plan: Plan, game: Game, key: PRNGKeyArray, evaders: Pool, pursuer: Network | None = None
) -> TrainState:
    """The state before the first step. The key is consumed.

    Args:
        evaders: who is chased.
        pursuer: the network to go on from; None starts from scratch (Algorithm 1, line 2).
    """
    network_key, stage_key = jax.random.split(key)
    return start(plan, game, stage_key, first_learner(plan, network_key, pursuer), evaders)
