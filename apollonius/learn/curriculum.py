"""The two stages of the curriculum: Algorithm 1, one side against players that stay as they are; Algorithm 2, both
against each other.

Beyond the paper, those of Algorithm 2 may meet earlier versions too: at intervals both learners enter their archives,
seats are drawn again by a scheme (`apollonius.learn.opponents`), and the games of these seats begin again.
"""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.pool import Pool
from apollonius.agents.trained import load_network
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import ROLES, Role
from apollonius.learn import archive, replay_buffer
from apollonius.learn.algorithm import algorithm_of, fitted
from apollonius.learn.config import RunConfig
from apollonius.learn.train_state import LearnerState, Plan, TrainState, first_learner, players
from apollonius.learn.train_step import Metrics, play_and_learn
from apollonius.observe.registry import find_observation
from apollonius.play.rollout import Games, begin, fresh_player, reset_where_done

NO_NETWORKS: BySide[Network | None] = BySide(None, None)
"""Both sides start from random weights."""


def start(
    plan: Plan,
    game: Game,
    key: PRNGKeyArray,
    fixed: Mapping[Role, Pool],
    networks: BySide[Network | None] = NO_NETWORKS,
) -> TrainState:
    """Return the state before the first step: empty memories, the networks (lines 1 to 3, or 1 to 4).

    Args:
        key: consumed.
        fixed: the players of a side that does not learn; in the paper an evader that stays, or nobody.
        networks: those to go on from, in Algorithm 2 the pursuer's best of stage 1; None starts from random weights.
    """
    learning = [role for role in Role if role not in fixed]
    *network_keys, stage_key = jax.random.split(key, 1 + len(learning))
    learners = {
        role: first_learner(plan, role, network_key, networks[role])
        for role, network_key in zip(learning, network_keys, strict=True)
    }
    start_key, member_key, train_key = jax.random.split(stage_key, 3)
    games = plan.learner.games
    bits = jax.random.bits(member_key, (2, games), jnp.uint32)

    def memory(role: Role) -> replay_buffer.ReplayBuffer[replay_buffer.Row]:
        size, robots = find_observation(plan.learner.observation).size, len(game.bodies[role])
        action, of_teams = algorithm_of(plan.learner).action, game.teams is not None
        return replay_buffer.init(plan.learner.rows, games * robots, size, action, of_teams)

    archives = None
    if plan.opponents.share > 0:
        archives = ROLES.map(lambda role: archive.init(learners[role].network, plan.opponents))
    own = {role: learner.network for role, learner in learners.items()}
    playing = ROLES.map(lambda role: players(plan, role, own, fixed, archives, jnp.ones(())))
    return TrainState(
        games=begin(reset_batch(game, start_key, games), playing, bits, plan.stage.disturbance),
        learners={role: LearnerState(learner, memory(role)) for role, learner in learners.items()},
        key=train_key,
        iterations=jnp.zeros((), jnp.int32),
        env_steps=jnp.zeros((), jnp.int32),
        episodes=jnp.zeros((), jnp.int32),
        archives=archives,
    )


def chunks(
    plan: Plan, game: Game, state: TrainState, fixed: Mapping[Role, Pool], done: int = 0
) -> Iterator[tuple[TrainState, Metrics]]:
    """Train a stage chunk by chunk (from line 4 or 5 on, as `train_step` has them).

    Args:
        game: with the rewards of the stage.
        state: before the next chunk; each state is consumed by the next one.
        fixed: the players of a side that does not learn.
        done: chunks done before.
    """
    for chunk in range(done, plan.chunks):
        if plan.renews_after(chunk):
            state = renew_opponents(plan, game, state)
        state, metrics = play_and_learn(plan, game, state, fixed)
        yield state, metrics


def load_first(config: RunConfig, role: Role) -> Network | None:
    """Return the network that a side goes on from, if the config names one.

    Raises:
        InvalidInput: when there is no such agent, or its network is not of the kind that the config trains.
    """
    name = config.first[role]
    return None if name is None else fitted(load_network(name, role), config.learner, role.name.lower(), name)


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
    seated = jnp.arange(games) < config.first_game(len(Role), games)
    bits = jax.random.bits(jax.random.fold_in(start_key, 1), (2, games), jnp.uint32)
    disturbance, robots = plan.stage.disturbance, state.games.state.robots
    fresh = ROLES.map(
        lambda role: fresh_player(state.games.sides[role].member, bits[role], disturbance, len(robots[role]))
    )

    return replace(
        state,
        games=jax.vmap(reset_where_done)(seated, Games(reset_batch(game, start_key, games), fresh), state.games),
        learners={
            role: replace(side, buffer=replay_buffer.cut(side.buffer, seated)) for role, side in state.learners.items()
        },
        archives=ROLES.map(lambda role: archive.renew(entered[role], config, keys[role])),
    )
