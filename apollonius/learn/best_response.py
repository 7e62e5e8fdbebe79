"""A best response: one side learns against a player of the other side that stays as it is."""

from collections.abc import Callable

import jax

from apollonius.agents.network import Network
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import solo
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.learn.stage import play_and_learn
from apollonius.learn.state import Plan, first_learner, start


def best_response(
    plan: Plan,
    game: Game,
    opponent: AbstractPolicy,
    role: Role,
    seed: int,
    first: Network | None = None,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> Network:
    """The network, averaged, that one side has learned after a stage against a fixed player.

    What it wins is a lower bound of what a best response could: learning need not find one.

    Args:
        plan: how to learn and for how long; rewards are weighed as it says.
        opponent: who is responded to.
        role: the side that learns.
        seed: of everything random.
        first: the network to go on from; None starts from random weights.
        report: told how many env steps are done, and how many there are.
    """
    network_key, stage_key = jax.random.split(jax.random.key(seed))
    learner = first_learner(plan, network_key, first)
    fixed, rewarded = solo(opponent), plan.stage.rewarded(game)
    if role == Role.PURSUER:
        state = start(plan, game, stage_key, learner, fixed)
    else:
        state = start(plan, game, stage_key, fixed, learner)
    pursuer, evader = (None, fixed) if role == Role.PURSUER else (fixed, None)
    for _ in range(plan.chunks):
        state, _ = play_and_learn(plan, rewarded, state, pursuer, evader)
        report(int(state.env_steps), plan.chunks * plan.env_steps_per_chunk)
    side = state.pursuer if role == Role.PURSUER else state.evader
    assert side is not None, "this side learns"
    return side.learner.average
