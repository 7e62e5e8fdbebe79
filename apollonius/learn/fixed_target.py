"""Stage 1, Algorithm 1: one side learns against players that do not; in the paper a pursuer, against an evader that
stays.
"""

from collections.abc import Iterator

import jax
from jaxtyping import PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.pool import Pool
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.learn.train_state import Plan, TrainState, first_learner, start
from apollonius.learn.train_step import Metrics, play_and_learn


def start_fixed_target(
    plan: Plan,
    game: Game,
    key: PRNGKeyArray,
    opponents: Pool,
    network: Network | None = None,
    role: Role = Role.PURSUER,
) -> TrainState:
    """The state before the first step: an empty memory, the networks (lines 1 to 3). The key is consumed.

    Args:
        opponents: who is learned against.
        network: the one to go on from; None starts from random weights (line 2).
        role: the side that learns.
    """
    network_key, stage_key = jax.random.split(key)
    learner = first_learner(plan, role, network_key, network)
    return start(plan, game, stage_key, {role: learner}, {role.other: opponents})


def fixed_target(
    plan: Plan, game: Game, state: TrainState, opponents: Pool, done: int = 0
) -> Iterator[tuple[TrainState, Metrics]]:
    """The stage chunk by chunk (lines 4 to 13, as `train_step` has them); each state is consumed by the next one.

    Args:
        game: with the rewards of the stage.
        state: before the next chunk.
        opponents: who is learned against.
        done: chunks done before.
    """
    fixed = {role: opponents for role in Role if role not in state.learners}
    for _ in range(done, plan.chunks):
        state, metrics = play_and_learn(plan, game, state, fixed)
        yield state, metrics
