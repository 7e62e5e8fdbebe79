"""Algorithms 1 and 2: every game is played on, each learning side stores its transitions and
updates its network.

In Algorithm 1 the other side is fixed; in Algorithm 2 both sides learn, against each other and, by
a scheme, against earlier versions (`apollonius.learn.archive`), which are drawn again at intervals.
"""

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.pool import Pool
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import ROLES, BySide, GameState, Outcome, Role, Scalar, tree_where
from apollonius.learn import archive, replay_buffer
from apollonius.learn.algorithm import Learner, ReplayConfig, interpolate_linearly
from apollonius.learn.stage_config import Plan
from apollonius.learn.train_state import LearnerState, TrainState, players
from apollonius.play.autoreset import row_at_turn
from apollonius.play.rollout import Transition, collect, init_games

_STARTS_PER_CHUNK = 4096
"""Initial states drawn before each chunk; a game that ends takes one."""
_STARTS_IN_ARENAS = 1024
"""Initial states drawn in games of several arenas, where each takes as long to draw as some ten
steps to play.
"""


class Metrics(eqx.Module):
    """Sums over a chunk: finished games by outcome, their returns, and each learner's losses and
    number of updates.

    The return of a team is the mean of its robots'.
    """

    outcomes: Int[Array, " outcomes"]
    returns: BySide[Scalar]
    losses: BySide[Scalar]
    updates: Int[Array, ""]


def chunks(
    plan: Plan, game: Game, state: TrainState, fixed: Mapping[Role, Pool], done: int = 0
) -> Iterator[tuple[TrainState, Metrics]]:
    """Train a stage chunk by chunk, in the game with its rewards; each state is consumed by the
    next one.
    """
    for chunk in range(done, plan.chunks):
        if plan.resamples_after(chunk):
            state = resample_all_opponents(plan, game, state)
        state, metrics = train_chunk(plan, game, state, fixed)
        yield state, metrics


def train_round_robin(
    play: Callable[[Plan, TrainState, Any], tuple[TrainState, Metrics]],
    plan: Plan,
    state: TrainState,
    settings: Sequence[Any],
    done: int = 0,
) -> Iterator[tuple[TrainState, Metrics]]:
    """Train a stage of one side chunk by chunk, in settings that take turns, each with games of its
    own; each state is consumed by the next one.
    """
    for chunk in range(done, plan.chunks):
        number, games = chunk % len(settings), list(state.games)
        state, metrics = play(plan, replace(state, games=games[number]), settings[number])
        games[number] = state.games
        state = replace(state, games=tuple(games))
        yield state, metrics


@functools.partial(jax.jit, static_argnames="plan", donate_argnames="state")
def train_chunk(
    plan: Plan, game: Game, state: TrainState, fixed: Mapping[Role, Pool]
) -> tuple[TrainState, Metrics]:
    """Return the state after a chunk and its metrics. The state is consumed: replay buffers are
    updated in place.
    """
    steps, games = plan.learner.steps_per_iteration, plan.learner.games
    drawn_at_once = _STARTS_PER_CHUNK if game.scenario is None else _STARTS_IN_ARENAS
    rows = max(1, drawn_at_once // (games * steps))
    drawn = reset_batch(game, _key(state, 0), rows * steps * games)
    starts = jax.tree.map(lambda leaf: leaf.reshape(rows, steps, games), drawn)

    def one_iteration(state: TrainState, index: Int[Array, ""]) -> tuple[TrainState, Metrics]:
        return _iterate(plan, game, state, fixed, row_at_turn(starts, index))

    after, metrics = jax.lax.scan(
        one_iteration, state, jnp.arange(plan.learner.iterations_per_chunk)
    )
    return after, jax.tree.map(lambda leaf: jnp.sum(leaf, axis=0), metrics)


def _iterate(
    plan: Plan, game: Game, state: TrainState, fixed: Mapping[Role, Pool], starts: GameState
) -> tuple[TrainState, Metrics]:
    """Play some steps of every game, store the transitions, update each learning side."""
    config, (play_key, *learn_keys) = plan.learner, jax.random.split(_key(state, 1), 3)
    playing = players(plan, state, fixed)
    games, played = collect(
        game, playing, state.games, starts, play_key, config.steps_per_iteration
    )
    env_steps = state.env_steps + config.env_steps_per_iteration
    learned = {
        role: _learn(plan, side, row_of(plan, played, role), env_steps, learn_keys[role])
        for role, side in state.learners.items()
    }
    return after_iteration(
        state, games, played, env_steps, learned, _record_results(plan, game, state, played)
    )


def after_iteration(
    state: TrainState,
    games: Any,
    played: Transition,
    env_steps: Int[Array, ""],
    learned: Mapping[Role, tuple[LearnerState, Scalar]],
    archives: BySide[archive.Archive] | None = None,
) -> tuple[TrainState, Metrics]:
    """Return the state after an iteration, and its metrics; `learned` has the losses of the updates
    of each side.
    """
    ended, first = played.ended, min(learned)
    learners = {role: side for role, (side, _) in learned.items()}
    episodes = state.episodes + jnp.sum(ended.astype(jnp.int32))
    after = TrainState(
        games, learners, state.key, state.iterations + 1, env_steps, episodes, archives
    )

    def finished(returns: Array) -> Scalar:
        of_side = returns if returns.ndim == 2 else jnp.mean(returns, axis=2)
        return jnp.sum(jnp.where(ended, of_side, 0.0))

    return after, Metrics(
        outcomes=jnp.stack(
            [
                jnp.sum((ended & (played.outcome == outcome)).astype(jnp.int32))
                for outcome in Outcome
            ]
        ),
        returns=played.sides.map(lambda side: finished(side.episode_return)),
        losses=ROLES.map(lambda role: learned[role][1] if role in learned else jnp.zeros(())),
        updates=learners[first].learner.updates - state.learners[first].learner.updates,
    )


def _learn(
    plan: Plan,
    side: LearnerState,
    new: replay_buffer.Row,
    env_steps: Int[Array, ""],
    key: PRNGKeyArray,
) -> tuple[LearnerState, Scalar]:
    """Store one side's transitions and make its updates; return their losses, added up."""
    config, stage = plan.learner, plan.stage.env_steps
    assert isinstance(config, ReplayConfig)
    buffer = replay_buffer.add(side.buffer, new)
    rate = interpolate_linearly(config.learning_rate, config.final_learning_rate, stage, env_steps)
    n_step = jnp.round(
        interpolate_linearly(config.n_step, config.final_n_step, stage, env_steps)
    ).astype(jnp.int32)

    def update(learner: Learner, key: PRNGKeyArray) -> tuple[Learner, Scalar]:
        batch = replay_buffer.sample_batch(
            buffer, key, config.batch, config.n_step, n_step, config.gamma
        )
        return config.update(learner, batch, rate, key)

    def updates(learner: Learner) -> tuple[Learner, Scalar]:
        learner, losses = jax.lax.scan(
            update, learner, jax.random.split(key, config.updates_per_iteration)
        )
        return learner, jnp.sum(losses)

    is_ready = (env_steps >= config.learning_starts) & (buffer.filled > config.n_step)
    learner, loss = jax.lax.cond(
        is_ready, updates, lambda learner: (learner, jnp.zeros(())), side.learner
    )
    return LearnerState(config.end_iteration(learner, env_steps), buffer), loss


def row_of(plan: Plan, played: Transition, role: Role) -> replay_buffer.Row:
    """Return one side's transitions, of a team those of each robot, whose game is over when it is
    out of play.
    """
    side, flags = played.sides[role], (played.terminated, played.truncated)
    if plan.stage.limit_terminates:
        flags = played.ended, jnp.zeros_like(played.ended)
    content = side.observation, side.action, side.reward, side.next_observation
    robots = side.reward.size // played.terminated.size
    terminated, truncated = (
        jnp.repeat(flag, robots, axis=1).reshape(side.lost.shape) for flag in flags
    )
    row = replay_buffer.Row(*content, terminated | side.lost, truncated & ~side.lost, side.active)
    (steps, games), after = played.terminated.shape, side.reward.ndim
    return jax.tree.map(lambda leaf: leaf.reshape(steps, games * robots, *leaf.shape[after:]), row)


def _record_results(
    plan: Plan, game: Game, state: TrainState, played: Transition
) -> BySide[archive.Archive] | None:
    """Return the archives with the games counted that say how good their versions are."""
    old = state.archives
    if old is None:
        return None
    before = state.iterations * plan.learner.steps_per_iteration % plan.steps_per_assignment
    over = archive.unbiased_endings(
        played.ended, state.games.state.steps, before, plan.steps_per_assignment, game.max_steps
    )
    return ROLES.map(
        lambda role: archive.record_results(old[role], plan.opponents, role, played.outcome, over)
    )


@functools.partial(jax.jit, static_argnames="plan", donate_argnames="state")
def resample_all_opponents(plan: Plan, game: Game, state: TrainState) -> TrainState:
    """Add both learners to their archives where that is due, and draw the opponents in the slots
    again.

    The games of slots are broken off and begin again, so that an opponent never changes within a
    game. The state is consumed.
    """
    old = state.archives
    config = plan.opponents
    games = plan.learner.games
    assert old is not None
    interval = max(1, plan.stage.env_steps // config.versions)
    due = (
        state.env_steps // interval
        > (state.env_steps - plan.steps_per_assignment * games) // interval
    )
    start_key, *keys = jax.random.split(_key(state, 2), 3)
    entered = ROLES.map(
        lambda role: archive.add_version(old[role], state.learners[role].learner.average, due)
    )
    archives = ROLES.map(lambda role: archive.resample_opponents(entered[role], config, keys[role]))
    in_slots = jnp.arange(games) < config.first_game(len(Role), games)
    bits = jax.random.bits(jax.random.fold_in(start_key, 1), (2, games), jnp.uint32)
    fresh_games = init_games(
        game, reset_batch(game, start_key, games), players(plan, state, {}), bits
    )
    learners = {
        role: replace(side, buffer=replay_buffer.truncate_latest(side.buffer, in_slots))
        for role, side in state.learners.items()
    }
    broken_off = jax.vmap(tree_where)(in_slots, fresh_games, state.games)
    return replace(state, games=broken_off, learners=learners, archives=archives)


def _key(state: TrainState, use: int) -> PRNGKeyArray:
    return jax.random.fold_in(jax.random.fold_in(state.key, use), state.iterations)
