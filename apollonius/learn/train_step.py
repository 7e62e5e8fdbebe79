"""The order of events in training: games are played, each learning side remembers its part and updates its network.

What differs between Algorithm 1 and Algorithm 2 is who learns and whom they meet; the order of events is the same, and
it is here. The state enters only through `play_and_learn`, compiled with the state donated, so that the memory is
updated in place.
"""

import functools
from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from apollonius.agents.pool import PersistentNoise, Pool
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import ROLES, GameState, Outcome, Role, Scalar
from apollonius.learn import archive, replay_buffer
from apollonius.learn.algorithm import Learner, UpdateContext, algorithm_of
from apollonius.learn.train_state import LearnerState, Plan, TrainState, players
from apollonius.play.rollout import Players, Transition, collect

_STARTS_PER_CHUNK = 4096
"""Initial states drawn before each chunk; a game that ends takes one of them."""
_STARTS_IN_ARENAS = 1024
"""The same in games of several arenas, where each takes as long to draw as some ten steps to play."""


class Metrics(eqx.Module):
    """Sums over a chunk: finished games by outcome, returns of both sides, losses of the updates made by each learner.

    The return of a team is the mean of its robots'. `updates` is how many each of them made.
    """

    outcomes: Int[Array, " outcomes"]
    returns: BySide[Scalar]
    losses: BySide[Scalar]
    updates: Int[Array, ""]


@functools.partial(jax.jit, static_argnames="plan", donate_argnames="state")
def play_and_learn(plan: Plan, game: Game, state: TrainState, fixed: Mapping[Role, Pool]) -> tuple[TrainState, Metrics]:
    """One chunk of a stage: `plan.iterations_per_chunk` rounds of play and updates. The state is consumed.

    Args:
        fixed: who plays the sides that do not learn.

    Returns:
        The state after it, and what happened.
    """

    steps = plan.learner.steps_per_iteration
    drawn_at_once = _STARTS_PER_CHUNK if game.scenario is None else _STARTS_IN_ARENAS
    rows = max(1, drawn_at_once // (plan.learner.games * steps))
    pool_key = jax.random.fold_in(jax.random.fold_in(state.key, 0), state.iterations)
    drawn = reset_batch(game, pool_key, rows * steps * plan.learner.games)
    starts = jax.tree.map(lambda leaf: leaf.reshape(rows, steps, plan.learner.games), drawn)

    def one_iteration(state: TrainState, index: Int[Array, ""]) -> tuple[TrainState, Metrics]:
        fresh = jax.tree.map(lambda leaf: jax.lax.dynamic_index_in_dim(leaf, index % rows, keepdims=False), starts)
        return _iterate(plan, game, state, fixed, fresh)

    after, metrics = jax.lax.scan(one_iteration, state, jnp.arange(plan.iterations_per_chunk))
    return after, jax.tree.map(lambda leaf: jnp.sum(leaf, axis=0), metrics)


def _iterate(
    plan: Plan, game: Game, state: TrainState, fixed: Mapping[Role, Pool], starts: GameState
) -> tuple[TrainState, Metrics]:
    """One round: every game plays on, the transitions are stored, each learning side makes its updates."""
    play_key, *learn_keys = jax.random.split(jax.random.fold_in(jax.random.fold_in(state.key, 1), state.iterations), 3)
    playing = ROLES.map(lambda role: _players(plan, role, state, fixed))
    steps, disturbance = plan.learner.steps_per_iteration, plan.stage.disturbance
    games, transitions = collect(game, playing, state.games, starts, play_key, steps, disturbance)
    env_steps = state.env_steps + plan.learner.env_steps_per_iteration
    learned = {
        role: _learn(plan, side, transitions, role, env_steps, learn_keys[role])
        for role, side in state.learners.items()
    }
    ended = transitions.terminated | transitions.truncated
    after = TrainState(
        games=games,
        learners={role: side for role, (side, _) in learned.items()},
        key=state.key,
        iterations=state.iterations + 1,
        env_steps=env_steps,
        episodes=state.episodes + jnp.sum(ended.astype(jnp.int32)),
        archives=_recorded(plan, game, state, transitions, ended),
    )
    first = min(state.learners)
    return after, Metrics(
        outcomes=jnp.stack([jnp.sum((ended & (transitions.outcome == o)).astype(jnp.int32)) for o in Outcome]),
        returns=transitions.sides.map(lambda side: jnp.sum(jnp.where(ended, _of_side(side.episode_return), 0.0))),
        losses=ROLES.map(lambda role: learned[role][1] if role in learned else jnp.zeros(())),
        updates=after.learners[first].learner.updates - state.learners[first].learner.updates,
    )


def _players(plan: Plan, role: Role, state: TrainState, fixed: Mapping[Role, Pool]) -> Players:
    """Who plays one side, with random bits that last where it learns by an algorithm that wants it so."""
    algorithm = algorithm_of(plan.learner)
    amount = algorithm.exploration(plan.learner, plan.stage.epsilon[role], plan.stage.env_steps, state.env_steps)
    networks = {role: side.learner.network for role, side in state.learners.items()}
    playing = players(plan, role, networks, fixed, state.archives, amount)
    rounds = algorithm.noise_steps(plan.learner) // plan.learner.steps_per_iteration
    if role in fixed or rounds <= 1:
        return playing
    key = jax.random.fold_in(jax.random.fold_in(state.key, 4 + role), state.iterations // rounds)
    return PersistentNoise(playing, jax.random.bits(key, (plan.learner.games,), jnp.uint32))


def _learn(
    plan: Plan, side: LearnerState, transitions: Transition, role: Role, env_steps: Int[Array, ""], key: PRNGKeyArray
) -> tuple[LearnerState, Scalar]:
    """Store one side's transitions and make its updates; their losses, added up."""
    config, algorithm = plan.learner, algorithm_of(plan.learner)
    buffer = replay_buffer.add(side.buffer, _row(transitions, role))
    context = UpdateContext(env_steps, plan.stage.env_steps)
    n_step = jnp.round(context.between(config.n_step, config.final_n_step)).astype(jnp.int32)

    def update(learner: Learner, sample_key: PRNGKeyArray) -> tuple[Learner, Scalar]:
        batch = replay_buffer.sample(buffer, sample_key, config.batch, config.n_step, n_step, config.gamma)
        return algorithm.update(learner, batch, jax.random.fold_in(sample_key, 2), config, context)

    def updates(learner: Learner) -> tuple[Learner, Scalar]:
        learner, losses = jax.lax.scan(update, learner, jax.random.split(key, config.updates_per_iteration))
        return learner, jnp.sum(losses)

    enough = (env_steps >= config.learning_starts) & (buffer.filled > config.n_step)
    learner, loss = jax.lax.cond(enough, updates, lambda learner: (learner, jnp.zeros(())), side.learner)
    return LearnerState(algorithm.after_updates(learner, config, env_steps), buffer), loss


def _row(transitions: Transition, role: Role) -> replay_buffer.Row:
    """One side's transitions, those of each robot of a team. A robot's game is over when it is out of play."""
    part, flags = transitions.sides[role], (transitions.terminated, transitions.truncated)
    made = part.observation, part.action, part.reward, part.next_observation
    if part.active is None or part.lost is None:
        return replay_buffer.Row(*made, *flags)
    robots = part.reward.size // transitions.terminated.size
    terminated, truncated = (jnp.repeat(flag, robots, axis=1).reshape(part.lost.shape) for flag in flags)
    row = replay_buffer.Row(*made, terminated | part.lost, truncated & ~part.lost, part.active)
    steps, games = transitions.terminated.shape
    after = part.reward.ndim
    return jax.tree.map(lambda leaf: leaf.reshape(steps, games * robots, *leaf.shape[after:]), row)


def _of_side(values: Float[Array, "steps games *robots"]) -> Float[Array, "steps games"]:
    """What a side has in each game: of a team the mean over its robots."""
    return values if values.ndim == 2 else jnp.mean(values, axis=2)


def _recorded(
    plan: Plan, game: Game, state: TrainState, transitions: Transition, ended: Bool[Array, "steps games"]
) -> BySide[archive.Archive] | None:
    """The earlier versions, with the games counted that say how good they are."""
    if state.archives is None:
        return None
    before = state.iterations * plan.learner.steps_per_iteration % plan.sitting
    over = archive.counted(ended, state.games.state.steps, before, plan.sitting, game.max_steps)
    old = state.archives
    return ROLES.map(lambda role: archive.record(old[role], plan.opponents, role, transitions.outcome, over))
