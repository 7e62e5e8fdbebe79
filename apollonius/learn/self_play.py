"""Stage 2, Algorithm 2: pursuer and evader learn against each other at the same time.

Beyond the paper, they may meet earlier versions too: at intervals both learners enter their archives, seats are drawn
anew by a scheme (`apollonius.learn.opponents`), and the games of these seats begin anew.
"""

import functools
from collections.abc import Iterator
from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import ROLES, Role
from apollonius.learn.opponents import archive
from apollonius.learn.opponents.seats import has_seat
from apollonius.learn.replay_buffer import ReplayBuffer, cut
from apollonius.learn.train_state import LearnerState, Plan, TrainState, first_learner, start
from apollonius.learn.train_step import Metrics, play_and_learn
from apollonius.rollout import Games, fresh_player, reset_where_done


def start_self_play(plan: Plan, game: Game, key: PRNGKeyArray, networks: BySide[Network | None]) -> TrainState:
    """The state before the first step: empty memories, the networks (lines 1 to 4). The key is consumed.

    Args:
        networks: the ones to go on from, in the paper the pursuer's best of stage 1 (line 2); None starts from scratch,
            as the paper's evader (line 3).
    """
    *network_keys, stage_key = jax.random.split(key, 3)
    learners = {role: first_learner(plan, role, network_keys[role], networks[role]) for role in Role}
    return start(plan, game, stage_key, learners, {})


def self_play(plan: Plan, game: Game, state: TrainState, done: int = 0) -> Iterator[tuple[TrainState, Metrics]]:
    """The stage chunk by chunk (lines 5 to 14, as `train_step` has them); each state is consumed by the next one.

    Args:
        game: with the rewards of the stage.
        state: before the next chunk.
        done: chunks done before.
    """
    for chunk in range(done, plan.chunks):
        if plan.renews_after(chunk):
            state = renew_opponents(plan, game, state)
        state, metrics = play_and_learn(plan, game, state, {})
        yield state, metrics


@functools.partial(jax.jit, static_argnames="plan", donate_argnames="state")
def renew_opponents(plan: Plan, game: Game, state: TrainState) -> TrainState:
    """Enter both learners into their archives where that is due, and draw again who sits; the games of seats are
    broken off and begin again. The state is consumed.
    """
    if state.archives is None:
        return state
    config, games = plan.opponents, plan.learner.games
    interval = max(1, plan.stage.env_steps // config.versions)
    due = state.env_steps // interval > (state.env_steps - plan.sitting * games) // interval
    old, averages = state.archives, {role: side.learner.average for role, side in state.learners.items()}
    entered = ROLES.map(lambda role: archive.enter(old[role], averages[role], due))
    start_key, *keys = jax.random.split(jax.random.fold_in(jax.random.fold_in(state.key, 2), state.iterations), 3)
    seated = has_seat(config, games)
    bits = jax.random.bits(jax.random.fold_in(start_key, 1), (2, games), jnp.uint32)
    disturbance, robots = plan.stage.disturbance, state.games.state.robots
    fresh = ROLES.map(
        lambda role: fresh_player(state.games.sides[role].member, bits[role], disturbance, len(robots[role]))
    )

    def cut_short(side: LearnerState) -> LearnerState:
        assert isinstance(side.buffer, ReplayBuffer)
        return replace(side, buffer=cut(side.buffer, seated))

    return replace(
        state,
        games=jax.vmap(reset_where_done)(seated, Games(reset_batch(game, start_key, games), fresh), state.games),
        learners={role: cut_short(side) for role, side in state.learners.items()},
        archives=ROLES.map(lambda role: archive.renew(entered[role], config, keys[role])),
    )
