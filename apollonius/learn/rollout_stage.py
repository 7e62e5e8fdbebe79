"""Stages whose sides learn from the transitions of the games that they play."""

import functools
from abc import abstractmethod
from dataclasses import replace
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import AbstractPlayers, Pool, single_player
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import BySide, GameState, Role, Scalar
from apollonius.learn.algorithm import Algorithm, LearningSide
from apollonius.learn.replay_buffer import Row, rows_of
from apollonius.learn.stage import Metrics, Stage, TrainState
from apollonius.play.autoreset import row_at_turn
from apollonius.play.rollout import Games, Transition, collect, init_games

_STARTS_PER_CHUNK = 4096
"""Initial states drawn before each chunk; a game that ends takes one."""
_STARTS_IN_ARENAS = 1024
"""Initial states drawn in games of several arenas, where each takes as long to draw as some ten
steps to play.
"""
_MOST_STARTS = 32
"""Initial states drawn for each game of an iteration; one that begins more often takes some again.
"""
S = TypeVar("S", bound=TrainState)


class RolloutStage(Stage):
    """A stage whose sides learn from the transitions of the games that they play.

    Attributes:
        game: the game of training.
    """

    algorithm: eqx.AbstractVar[Algorithm]
    game: eqx.AbstractVar[Game]

    @abstractmethod
    def players(self, state: Any) -> BySide[AbstractPlayers]:
        """Return the players of both sides in the games of training."""

    @abstractmethod
    def iterate(self, state: Any, starts: GameState) -> tuple[Any, Metrics]:
        """Play some steps of every game, and let each learning side learn from them."""

    def step(self, state: Any) -> tuple[Any, Metrics]:
        return train_chunk(self, state)

    def play(
        self, state: TrainState, starts: GameState, key: PRNGKeyArray
    ) -> tuple[Games, Transition]:
        """Play some steps of every game; one that is over begins again from a start."""
        return collect(
            self.game,
            self.players(state),
            state.games,
            starts,
            key,
            self.algorithm.steps_per_iteration,
            with_next_obs=self.algorithm.reads_next_observation,
        )

    def learn(
        self,
        state: TrainState,
        role: Role,
        played: Transition,
        env_steps: Int[Array, ""],
        key: PRNGKeyArray,
    ) -> tuple[LearningSide[Any], Scalar]:
        """Let a side learn from its transitions; return it, and the losses of its updates, added
        up.
        """
        rows = rows_of(played, role, self.config.limit_terminates)
        rows = replace(rows, reward=rows.reward / self.algorithm.reward_unit(self.game))
        if self.algorithm.on_policy:
            rows = without_earlier_versions(rows, played.sides[role].member)
        side = state.learners[role]
        return self.algorithm.learn(side, rows, self.config.env_steps, env_steps, key)

    def init_side(
        self, role: Role, key: PRNGKeyArray, network: Network | None
    ) -> LearningSide[Any]:
        """Make a side that learns. The key is consumed."""
        robots = len(self.game.bodies[role])
        return self.algorithm.init_side(key, network, robots)

    def begin_games(self, state: S, key: PRNGKeyArray, member_key: PRNGKeyArray) -> S:
        """Return a state that has no games with games at their starts. Both keys are consumed."""
        games = self.algorithm.games
        bits = jax.random.bits(member_key, (2, games), jnp.uint32)
        starts = reset_batch(self.game, key, games)
        first_games = init_games(self.game, starts, self.players(state), bits)
        # Apart: at the start what a side knows is the state itself.
        return replace(state, games=jax.tree.map(jnp.array, first_games))

    def explorer_policy(self, state: TrainState, role: Role) -> AbstractPolicy:
        """Return the player that explores for a side that learns."""
        amount = self.algorithm.exploration(
            self.config.epsilon[role], self.config.env_steps, state.env_steps
        )
        return self.algorithm.explorer(state.learners[role].learner.network, amount)

    def explorer(self, state: TrainState, role: Role) -> Pool:
        """Return the players of a side that learns: one, with noise that lasts where the algorithm
        says so.
        """
        pool = single_player(self.explorer_policy(state, role))
        return replace(pool, bits=self.noise(state, role))

    def noise(self, state: TrainState, role: Role) -> Array | None:
        """Return the random bits by which a side explores in each game; None where each step has
        its own.
        """
        noise_block = self.algorithm.noise_block(state.iterations)
        if noise_block is None:
            return None
        key = jax.random.fold_in(jax.random.fold_in(state.key, 4 + role), noise_block)
        return jax.random.bits(key, (self.algorithm.games,), jnp.uint32)


def without_earlier_versions(rows: Row, member: Int[Array, "steps games"]) -> Row:
    """Return a side's transitions, of which those do not count that earlier versions played."""
    robots = rows.active.shape[1] // member.shape[1]
    is_own = jnp.repeat(member == 0, robots, axis=1)
    return replace(rows, active=rows.active & is_own)


@functools.partial(jax.jit, donate_argnames="state")
def train_chunk(stage: RolloutStage, state: S) -> tuple[S, Metrics]:
    """Train a chunk. The state is consumed: replay buffers are updated in place."""
    algorithm = stage.algorithm
    games = algorithm.games
    steps = min(algorithm.steps_per_iteration, _MOST_STARTS)
    drawn_at_once = _STARTS_PER_CHUNK if stage.game.scenario is None else _STARTS_IN_ARENAS
    rows = max(1, drawn_at_once // (games * steps))
    drawn = reset_batch(stage.game, state.iteration_key(0), rows * steps * games)
    starts = jax.tree.map(lambda leaf: leaf.reshape(rows, steps, games, *leaf.shape[1:]), drawn)

    def iterate(state: S, index: Int[Array, ""]) -> tuple[S, Metrics]:
        return stage.iterate(state, row_at_turn(starts, index))

    after, metrics = jax.lax.scan(iterate, state, jnp.arange(algorithm.iterations_per_chunk))
    return after, jax.tree.map(lambda leaf: jnp.sum(leaf, axis=0), metrics)
