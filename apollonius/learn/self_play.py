"""Stage 2, Algorithm 2: pursuer and evader learn against each other at the same time."""

import jax
from jaxtyping import PRNGKeyArray

from apollonius.agents.network import QNetwork
from apollonius.game.game import Game
from apollonius.learn import dqn
from apollonius.learn.state import Plan, TrainState, start


def start_self_play(plan: Plan, game: Game, key: PRNGKeyArray, pursuer: QNetwork | None) -> TrainState:
    """The state before the first step. The key is consumed.

    Args:
        pursuer: the network to go on from, the best of stage 1; None starts from scratch (section V-A). The evader
            always starts from scratch (Algorithm 2, line 3).
    """
    pursuer_key, evader_key, stage_key = jax.random.split(key, 3)
    chaser = dqn.init(plan.dqn, pursuer_key) if pursuer is None else dqn.start_from(pursuer)
    return start(plan, game, stage_key, chaser, dqn.init(plan.dqn, evader_key))
