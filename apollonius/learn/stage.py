"""One stage of training: games are played, each learning side remembers its part and updates its network.

What differs between Algorithm 1 and Algorithm 2 is who learns; the order of events is the same, and it is here.
The state enters only through `play_and_learn`, compiled with the state donated, so that the replay is updated in place.
"""

import functools
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from apollonius.agents.greedy import EpsilonGreedy, Greedy
from apollonius.agents.policy import Pool, solo
from apollonius.game.game import Game, reset_batch
from apollonius.game.observation import OBSERVATION_SIZES
from apollonius.game.types import GameState, Outcome, Role, Scalar
from apollonius.learn import dqn, replay
from apollonius.learn.config import DQNConfig, StageConfig
from apollonius.learn.schedule import linear
from apollonius.rollout import Games, Side, Transition, begin, collect

_STARTS_PER_CHUNK = 4096
"""Initial states drawn before each chunk; a game that ends takes one of them."""
_CHUNK_ENV_STEPS = 8192
"""Env steps between two looks from outside (progress, checkpoints, Ctrl-C), where iterations are small enough."""


class Learning(eqx.Module):
    """One learning side: its networks and its memory."""

    learner: dqn.Learner
    replay: replay.Replay


class TrainState(eqx.Module):
    """Everything that changes while a stage is trained; a side that does not learn is None.

    `key` is folded with the number of iterations, never replaced. `env_steps` counts steps of single games.
    """

    games: Games
    pursuer: Learning | None
    evader: Learning | None
    key: PRNGKeyArray
    iterations: Int[Array, ""]
    env_steps: Int[Array, ""]
    episodes: Int[Array, ""]


class Metrics(eqx.Module):
    """Sums over a chunk: finished games by outcome, returns of both sides, losses of the updates made."""

    outcomes: Int[Array, "8"]
    pursuer_return: Scalar
    evader_return: Scalar
    pursuer_loss: Scalar
    evader_loss: Scalar
    updates: Int[Array, ""]


@dataclass(frozen=True)
class Plan:
    """The fixed part of a stage: how to learn and for how long. Hashable, so it is static under `jit`."""

    dqn: DQNConfig
    stage: StageConfig

    @property
    def iterations_per_chunk(self) -> int:
        """Rounds of play and updates in one compiled call."""
        return max(8, _CHUNK_ENV_STEPS // self.dqn.env_steps_per_iteration)

    @property
    def env_steps_per_chunk(self) -> int:
        """Env steps in one compiled call."""
        return self.iterations_per_chunk * self.dqn.env_steps_per_iteration

    @property
    def chunks(self) -> int:
        """Compiled calls in the whole stage."""
        return -(-self.stage.env_steps // self.env_steps_per_chunk)


def start(
    plan: Plan,
    game: Game,
    key: PRNGKeyArray,
    pursuer: dqn.Learner | Pool,
    evader: dqn.Learner | Pool,
) -> TrainState:
    """The state before the first step. A side given as a `Learner` learns; one given as a `Pool` does not.

    The key is consumed.
    """
    start_key, member_key, train_key = jax.random.split(key, 3)
    games = plan.dqn.games
    words = jax.random.bits(member_key, (2, games), jnp.uint32)
    pursuers, evaders = (side if isinstance(side, Pool) else solo(Greedy(side.network)) for side in (pursuer, evader))
    return TrainState(
        games=begin(reset_batch(game, start_key, games), pursuers, evaders, words),
        pursuer=_remember(plan, pursuer),
        evader=_remember(plan, evader),
        key=train_key,
        iterations=jnp.zeros((), jnp.int32),
        env_steps=jnp.zeros((), jnp.int32),
        episodes=jnp.zeros((), jnp.int32),
    )


def _remember(plan: Plan, side: dqn.Learner | Pool) -> Learning | None:
    if isinstance(side, Pool):
        return None
    size = OBSERVATION_SIZES[plan.dqn.observation]
    return Learning(side, replay.init(plan.dqn.rows, plan.dqn.games, size))


@functools.partial(jax.jit, static_argnames="plan", donate_argnames="state")
def play_and_learn(
    plan: Plan, game: Game, state: TrainState, pursuer: Pool | None, evader: Pool | None
) -> tuple[TrainState, Metrics]:
    """One chunk of a stage: `plan.iterations_per_chunk` rounds of play and updates. The state is consumed.

    Args:
        pursuer, evader: the players of a side that does not learn; None for one that does.
    """
    steps = plan.dqn.steps_per_iteration
    rows = max(1, _STARTS_PER_CHUNK // (plan.dqn.games * steps))
    pool_key = jax.random.fold_in(jax.random.fold_in(state.key, 0), state.iterations)
    drawn = reset_batch(game, pool_key, rows * steps * plan.dqn.games)
    starts = jax.tree.map(lambda leaf: leaf.reshape(rows, steps, plan.dqn.games), drawn)

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
    pursuers = pursuer or _explorer(plan, state, state.pursuer, plan.stage.pursuer_epsilon)
    evaders = evader or _explorer(plan, state, state.evader, plan.stage.evader_epsilon)
    games, transitions = collect(game, pursuers, evaders, state.games, starts, play_key, plan.dqn.steps_per_iteration)
    env_steps = state.env_steps + plan.dqn.env_steps_per_iteration
    pursuer_side, pursuer_loss = _learn(plan, state.pursuer, transitions, Role.PURSUER, env_steps, pursuer_key)
    evader_side, evader_loss = _learn(plan, state.evader, transitions, Role.EVADER, env_steps, evader_key)
    over = transitions.terminated | transitions.truncated
    after = TrainState(
        games=games,
        pursuer=pursuer_side,
        evader=evader_side,
        key=state.key,
        iterations=state.iterations + 1,
        env_steps=env_steps,
        episodes=state.episodes + jnp.sum(over.astype(jnp.int32)),
    )
    return after, Metrics(
        outcomes=jnp.stack([jnp.sum((over & (transitions.outcome == o)).astype(jnp.int32)) for o in Outcome]),
        pursuer_return=jnp.sum(jnp.where(over, transitions.pursuer.episode_return, 0.0)),
        evader_return=jnp.sum(jnp.where(over, transitions.evader.episode_return, 0.0)),
        pursuer_loss=pursuer_loss,
        evader_loss=evader_loss,
        updates=_updates(after) - _updates(state),
    )


def _updates(state: TrainState) -> Int[Array, ""]:
    """Updates made so far by each learning side."""
    side = state.pursuer or state.evader
    assert side is not None, "one side at least must learn"
    return side.learner.updates


def _explorer(plan: Plan, state: TrainState, side: Learning | None, first_epsilon: float) -> Pool:
    assert side is not None, "a side without players must learn"
    over = plan.dqn.exploration_fraction * plan.stage.env_steps
    epsilon = linear(first_epsilon, plan.dqn.final_epsilon, over, state.env_steps)
    return solo(EpsilonGreedy(side.learner.network, epsilon))


def _learn(
    plan: Plan,
    side: Learning | None,
    transitions: Transition,
    role: Role,
    env_steps: Int[Array, ""],
    key: PRNGKeyArray,
) -> tuple[Learning | None, Float[Array, ""]]:
    """Store one side's transitions, make its updates, copy its network to the target where that is due."""
    if side is None:
        return None, jnp.zeros(())
    config = plan.dqn
    part: Side = transitions.pursuer if role == Role.PURSUER else transitions.evader
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
    rate = linear(config.learning_rate, config.final_learning_rate, plan.stage.env_steps, env_steps)

    def update(learner: dqn.Learner, sample_key: PRNGKeyArray) -> tuple[dqn.Learner, Scalar]:
        batch = replay.sample(memory, sample_key, config.batch, config.n_step, n_step, config.gamma)
        return dqn.update(learner, batch, rate, config)

    def updates(learner: dqn.Learner) -> tuple[dqn.Learner, Scalar]:
        learner, losses = jax.lax.scan(update, learner, jax.random.split(key, config.updates_per_iteration))
        return learner, jnp.sum(losses)

    enough = (env_steps >= config.learning_starts) & (memory.filled > config.n_step)
    learner, loss = jax.lax.cond(enough, updates, lambda learner: (learner, jnp.zeros(())), side.learner)
    copies = env_steps // config.target_period > (env_steps - config.env_steps_per_iteration) // config.target_period
    return Learning(dqn.copy_to_target(learner, copies), memory), loss
