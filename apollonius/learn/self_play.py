"""Stage 2, Algorithm 2: pursuer and evader learn against each other at the same time."""

import jax
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.network import QNetwork
from apollonius.game.game import Game
from apollonius.learn import dqn
from apollonius.learn.state import Plan, TrainState, start


def start_self_play(
    plan: Plan,
    game: Game,
    key: PRNGKeyArray,
    pursuer: QNetwork | None,
    evader: QNetwork | None = None,
    device: Int[Array, ""] | None = None,
) -> TrainState:
    """The state before the first step. The key is consumed.

    Args:
        pursuer: the network to go on from, the best of stage 1; None starts from scratch (section V-A).
        evader: the same for the evader; None starts from scratch (Algorithm 2, line 3).
        device: number of the device, if several share the stage: all begin with the same networks, each with games and
            random numbers of its own.
    """
    pursuer_key, evader_key, stage_key = jax.random.split(key, 3)
    if device is not None:
        stage_key = jax.random.fold_in(stage_key, device)
    chaser = dqn.init(plan.dqn, pursuer_key) if pursuer is None else dqn.start_from(pursuer)
    runner = dqn.init(plan.dqn, evader_key) if evader is None else dqn.start_from(evader)
    return start(plan, game, stage_key, chaser, runner)
