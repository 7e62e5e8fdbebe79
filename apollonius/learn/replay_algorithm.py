"""The base of algorithms that learn from a replay buffer: size, n-step returns, update times."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.game.types import Scalar
from apollonius.io.errors import require, require_positive, require_within
from apollonius.io.limits import TRANSITIONS
from apollonius.learn.algorithm import Algorithm, L, LearningSide, interpolate_linearly
from apollonius.learn.replay_buffer import Row, TransitionBatch, add, init_buffer, sample_batch
from apollonius.observe.registry import find_observation

_CHUNK_ENV_STEPS = 8192
"""Env steps between two looks from outside (progress, checkpoints, Ctrl-C), where iterations are
small enough.
"""


@dataclass(frozen=True)
class ReplayAlgorithm(Algorithm):
    """The numbers of the algorithms that learn from a replay buffer."""

    n_step: int = 16
    """Rewards summed before a value is bootstrapped, at the start of a stage: far-reaching, but of
    high variance.
    """
    final_n_step: int = 4
    """Rewards summed at the end of a stage, reached in a straight line: less noise, and closer to
    the value of the best action than of the explored one (annealed as in Schwarzer et al., "Bigger,
    Better, Faster", 2023).
    """
    averaging: float = 3e-4
    """Part of the way that the averaged weights go towards the network at each update; 1 plays the
    network itself.
    """
    env_steps_per_update: int = 512
    """Env steps between two updates of each learner."""
    replay_capacity: int = 524_288
    """Transitions kept, of teams those of each robot."""
    learning_starts: int = 40_000
    """Env steps before the first update."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(
            self, "n_step", "final_n_step", "averaging", "env_steps_per_update", "replay_capacity"
        )
        require_within(self, 0, 1, "averaging")
        TRANSITIONS.require("replay_capacity", self.replay_capacity)
        require(
            self.final_n_step <= self.n_step,
            "final_n_step",
            self.final_n_step,
            f"at most n_step = {self.n_step}",
        )
        steps, bound = self.env_steps_per_update, f"a multiple or a divisor of games = {self.games}"
        require(
            max(self.games, steps) % min(self.games, steps) == 0,
            "env_steps_per_update",
            steps,
            bound,
        )
        rows = 2 * (self.n_step + self.steps_per_iteration)
        bound = f"at least {rows * self.games} for these games and n_step"
        require(self.rows >= rows, "replay_capacity", self.replay_capacity, bound)

    @property
    def steps_per_iteration(self) -> int:
        return max(1, self.env_steps_per_update // self.games)

    @property
    def iterations_per_chunk(self) -> int:
        return max(8, _CHUNK_ENV_STEPS // self.env_steps_per_iteration)

    @property
    def updates_per_iteration(self) -> int:
        """Updates in a round."""
        return max(1, self.games // self.env_steps_per_update)

    @property
    def rows(self) -> int:
        """Time steps the replay holds: the capacity, rounded down to whole iterations."""
        return self.replay_capacity // self.env_steps_per_iteration * self.steps_per_iteration

    @property
    def steps_before_learning(self) -> int:
        return self.learning_starts

    @property
    def transitions(self) -> int:
        return self.replay_capacity

    @abstractmethod
    def init_learner(self, key: PRNGKeyArray, network: Any = None) -> Any:
        """Make a learner that starts from a copy of a network, or from random weights. The key is
        consumed.
        """

    @abstractmethod
    def update(
        self, learner: Any, batch: TransitionBatch, learning_rate: Scalar, key: PRNGKeyArray
    ) -> tuple[Any, Scalar]:
        """Return the learner after one update from a batch, and the loss before it. The key is
        consumed.
        """

    def end_iteration(self, learner: Any, env_steps: Int[Array, ""]) -> Any:
        """Return the learner at the end of an iteration, after `env_steps` of the stage."""
        return learner

    def init_side(
        self, key: PRNGKeyArray, network: Network | None, robots: int
    ) -> LearningSide[Any]:
        buffer = init_buffer(
            self.rows, self.games * robots, find_observation(self.observation).size, self.continuous
        )
        return LearningSide(self.init_learner(key, network), buffer)

    def learn(
        self,
        side: LearningSide[L],
        rows: Row,
        stage_env_steps: int,
        env_steps: Int[Array, ""],
        key: PRNGKeyArray,
    ) -> tuple[LearningSide[L], Scalar]:
        """Store the transitions and make the updates (Algorithm 1, lines 8 to 11)."""
        buffer = add(side.buffer, rows)
        learning_rate = interpolate_linearly(
            self.learning_rate, self.final_learning_rate, stage_env_steps, env_steps
        )
        steps = interpolate_linearly(self.n_step, self.final_n_step, stage_env_steps, env_steps)
        n_step = jnp.round(steps).astype(jnp.int32)

        def update(learner: L, key: PRNGKeyArray) -> tuple[L, Scalar]:
            batch = sample_batch(buffer, key, self.batch, self.n_step, n_step, self.gamma)
            return self.update(learner, batch, learning_rate, key)

        def updates(learner: L) -> tuple[L, Scalar]:
            keys = jax.random.split(key, self.updates_per_iteration)
            learner, losses = jax.lax.scan(update, learner, keys)
            return learner, jnp.sum(losses)

        def no_updates(learner: L) -> tuple[L, Scalar]:
            return learner, jnp.zeros(())

        is_ready = (env_steps >= self.learning_starts) & (buffer.filled > self.n_step)
        learner, loss = jax.lax.cond(is_ready, updates, no_updates, side.learner)
        return LearningSide(self.end_iteration(learner, env_steps), buffer), loss
