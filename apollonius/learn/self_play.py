"""Stage 2, Algorithm 2: pursuer and evader learn against each other at the same time."""

import jax
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.game.game import Game
from apollonius.learn.state import Plan, TrainState, first_learner, start


def start_self_play(
    plan: Plan, game: Game, key: PRNGKeyArray, pursuer: Network | None, device: Int[Array, ""] | None = None
) -> TrainState:
    """The state before the first step. The key is consumed.

    Args:
        pursuer: the network to go on from, the best of stage 1; None starts from scratch (section V-A). The evader
            always starts from scratch (Algorithm 2, line 3).
        device: number of the device, if several share the stage: all begin with the same networks, each with games and
            random numbers of its own.
    """
    pursuer_key, evader_key, stage_key = jax.random.split(key, 3)
    if device is not None:
        stage_key = jax.random.fold_in(stage_key, device)
    chaser, runner = first_learner(plan, pursuer_key, pursuer), first_learner(plan, evader_key)
    return start(plan, game, stage_key, chaser, runner)
