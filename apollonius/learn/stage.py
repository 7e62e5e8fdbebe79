"""One stage of training: games are played, each learning side remembers its part and updates its network.

What differs between Algorithm 1 and Algorithm 2 is who learns; the order of events is the same, and it is here.
The state enters only through `play_and_learn`, compiled with the state donated, so that the replay is updated in place.
"""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from apollonius.agents.pool import Held, Pool, Seated
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import GameState, Outcome, Role, Scalar
from apollonius.learn import opponents, replay
from apollonius.learn.algorithm import Learner, Moment, algorithm_of
from apollonius.learn.schedule import linear
from apollonius.learn.seats import against_learner
from apollonius.learn.state import Learning, Plan, TrainState, players
from apollonius.rollout import Players, Transition, collect

_STARTS_PER_CHUNK = 4096
"""Initial states drawn before each chunk; a game that ends takes one of them."""


class Metrics(eqx.Module):
    """Sums over a chunk: finished games by outcome, returns of both sides, losses of the updates made."""

    outcomes: Int[Array, " outcomes"]
    pursuer_return: Scalar
    evader_return: Scalar
    pursuer_loss: Scalar
    evader_loss: Scalar
    updates: Int[Array, ""]


@functools.partial(jax.jit, static_argnames="plan", donate_argnames="state")
def play_and_learn(
    plan: Plan, game: Game, state: TrainState, pursuer: Pool | None, evader: Pool | None
) -> tuple[TrainState, Metrics]:
    """One chunk of a stage: `plan.iterations_per_chunk` rounds of play and updates. The state is consumed.

    Args:
        pursuer, evader: the players of a side that does not learn; None for one that does.
    """
    steps = plan.learner.steps_per_iteration
    rows = max(1, _STARTS_PER_CHUNK // (plan.learner.games * steps))
    pool_key = jax.random.fold_in(jax.random.fold_in(state.key, 0), state.iterations)
    drawn = reset_batch(game, pool_key, rows * steps * plan.learner.games)
    starts = jax.tree.map(lambda leaf: leaf.reshape(rows, steps, plan.learner.games), drawn)

    def one_iteration(state: TrainState, index: Int[Array, ""]) -> tuple[TrainState, Metrics]:
        fresh = jax.tree.map(lambda leaf: jax.lax.dynamic_index_in_dim(leaf, index % rows, keepdims=False), starts)
        return _iterate(plan, game, state, pursuer, evader, fresh)

    state, metrics = jax.lax.scan(one_iteration, state, jnp.arange(plan.iterations_per_chunk))
    return state, jax.tree.map(lambda leaf: jnp.sum(leaf, axis=0), metrics)


def _iterate(
    plan: Plan, game: Game, state: TrainState, pursuer: Pool | None, evader: Pool | None, starts: GameState
) -> tuple[TrainState, Metrics]:
    """One round: every game plays on, the transitions are stored, each learning side makes its updates."""
    play_key, pursuer_key, evader_key = jax.random.split(
        jax.random.fold_in(jax.random.fold_in(state.key, 1), state.iterations), 3
    )
    exploration = algorithm_of(plan.learner).exploration
    amounts = [
        exploration(plan.learner, first, plan.stage.env_steps, state.env_steps)
        for first in (plan.stage.pursuer_epsilon, plan.stage.evader_epsilon)
    ]
    pursuers = _explorers(plan, Role.PURSUER, state, players(plan, Role.PURSUER, state.pursuer, pursuer, amounts[0]))
    evaders = _explorers(plan, Role.EVADER, state, players(plan, Role.EVADER, state.evader, evader, amounts[1]))
    steps, disturbance = plan.learner.steps_per_iteration, plan.stage.disturbance
    games, transitions = collect(game, BySide(pursuers, evaders), state.games, starts, play_key, steps, disturbance)
    env_steps = state.env_steps + plan.learner.env_steps_per_iteration
    pursuer_side, pursuer_loss = _learn(plan, game, state, transitions, Role.PURSUER, env_steps, pursuer_key)
    evader_side, evader_loss = _learn(plan, game, state, transitions, Role.EVADER, env_steps, evader_key)
    ended = transitions.terminated | transitions.truncated
    after = TrainState(
        games=games,
        pursuer=pursuer_side,
        evader=evader_side,
        key=state.key,
        iterations=state.iterations + 1,
        env_steps=env_steps,
        episodes=state.episodes + jnp.sum(ended.astype(jnp.int32)),
        payoffs=state.payoffs,
    )
    return after, Metrics(
        outcomes=jnp.stack([jnp.sum((ended & (transitions.outcome == o)).astype(jnp.int32)) for o in Outcome]),
        pursuer_return=jnp.sum(jnp.where(ended, transitions.sides.pursuer.episode_return, 0.0)),
        evader_return=jnp.sum(jnp.where(ended, transitions.sides.evader.episode_return, 0.0)),
        pursuer_loss=pursuer_loss,
        evader_loss=evader_loss,
        updates=_updates(after) - _updates(state),
    )


def _explorers(plan: Plan, role: Role, state: TrainState, players: Pool | Seated) -> Players:
    """The players of one side, with random words that last where it learns by an algorithm that wants it so."""
    side = state.pursuer if role == Role.PURSUER else state.evader
    rounds = algorithm_of(plan.learner).noise_steps(plan.learner) // plan.learner.steps_per_iteration
    if side is None or rounds <= 1:
        return players
    key = jax.random.fold_in(jax.random.fold_in(state.key, 4 + role), state.iterations // rounds)
    return Held(players, jax.random.bits(key, (plan.learner.games,), jnp.uint32))


def _updates(state: TrainState) -> Int[Array, ""]:
    """Updates made so far by each learning side."""
    side = state.pursuer or state.evader
    assert side is not None, "one side at least must learn"
    return side.learner.updates


def _learn(
    plan: Plan,
    game: Game,
    state: TrainState,
    transitions: Transition,
    role: Role,
    env_steps: Int[Array, ""],
    key: PRNGKeyArray,
) -> tuple[Learning | None, Float[Array, ""]]:
    """Store one side's transitions and make its updates. `state` is what there was before them."""
    side = state.pursuer if role == Role.PURSUER else state.evader
    if side is None:
        return None, jnp.zeros(())
    config, algorithm = plan.learner, algorithm_of(plan.learner)
    part = transitions.sides[role]
    memory = replay.add(
        side.replay,
        replay.Row(
            part.observation,
            part.action,
            part.reward,
            part.next_observation,
            transitions.terminated,
            transitions.truncated,
        ),
    )
    n_step = jnp.round(linear(config.n_step, config.final_n_step, plan.stage.env_steps, env_steps)).astype(jnp.int32)
    moment = Moment(env_steps, plan.stage.env_steps, plan.across)
    enough = (env_steps >= config.learning_starts) & (memory.filled > config.n_step) & _has_turn(plan, role, env_steps)

    def updated(learner: Learner, key: PRNGKeyArray, among: tuple[int, int] | None = None) -> tuple[Learner, Scalar]:
        """A learner after its updates, from these games of the memory only."""

        def update(learner: Learner, sample_key: PRNGKeyArray) -> tuple[Learner, Scalar]:
            batch = replay.sample(memory, sample_key, config.batch, config.n_step, n_step, config.gamma, among)
            return algorithm.update(learner, batch, jax.random.fold_in(sample_key, 2), config, moment)

        def updates(learner: Learner) -> tuple[Learner, Scalar]:
            learner, losses = jax.lax.scan(update, learner, jax.random.split(key, config.updates_per_iteration))
            return learner, jnp.sum(losses)

        learner, loss = jax.lax.cond(enough, updates, lambda learner: (learner, jnp.zeros(())), learner)
        return algorithm.after_updates(learner, config, env_steps), loss

    learner, loss = updated(side.learner, key)
    exploiter = side.exploiter
    if exploiter is not None:
        among = against_learner(plan.opponents, role, config.games)
        exploiter, _ = updated(exploiter, jax.random.fold_in(key, 1), among)
    archive = side.archive
    if archive is not None:
        ended = transitions.terminated | transitions.truncated
        before = state.iterations * config.steps_per_iteration % plan.sitting
        over = opponents.counted(ended, state.games.state.steps, before, plan.sitting, game.max_steps)
        archive = opponents.record(archive, plan.opponents, role, transitions.outcome, over)
    return Learning(learner, memory, archive, exploiter), loss


def _has_turn(plan: Plan, role: Role, env_steps: Int[Array, ""]) -> Bool[Array, ""]:
    """Whether a side learns now: always, unless the sides take turns."""
    if plan.opponents.scheme != "alternating":
        return jnp.ones((), bool)
    return ((env_steps - 1) // plan.opponents.renewal) % 2 == int(role)
