"""A stage of training: its numbers, its state, and what a run asks of it.

A run knows its stages by `init`, `step`, `agents` and `evaluate`, not by their kinds.
"""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.pool import Pool, single_player
from apollonius.agents.trained import greedy_policy
from apollonius.game.game import MAX_STEPS, Game, sample_starts
from apollonius.game.outcome import counts_by_name
from apollonius.game.presets import randomised
from apollonius.game.scenario import Spread
from apollonius.game.types import ROLES, BySide, Outcome, Role, Scalar
from apollonius.io.errors import require, require_positive, require_within
from apollonius.io.limits import GAMES
from apollonius.learn.algorithm import Algorithm, LearningSide, require_reward_in_play
from apollonius.play.playout import play_out
from apollonius.play.rollout import Transition

_EVALUATION_SEED = 20_200
"""Seed of the games of evaluations, the same for all runs; the final evaluation uses others."""


@dataclass(frozen=True)
class StageConfig:
    """Length, exploration, rewards and evaluations of a stage."""

    algorithm_class: ClassVar[type[Algorithm]] = Algorithm
    """Class of the algorithms that it can be trained by."""
    keeps_best: ClassVar[bool] = False
    """True to save the best agents of its evaluations at its end, in place of the last ones."""
    is_judged: ClassVar[bool] = True
    """True if matches between the agents of a run judge it at the end."""

    kind: str = ""
    """Name of the stage in a config."""
    env_steps: int = 19_000_000
    """Length of the stage."""
    pursuer_epsilon: float = 1.0
    """Share of random actions of a learning pursuer when the stage begins."""
    evader_epsilon: float = 1.0
    """Share of random actions of a learning evader when the stage begins."""
    progress: float = 3.0
    """Weight c of Eq. 8 and 9 [1/m] while training, in place of the game's own."""
    failure: float = 10.0
    """Price of a robot's own failure (Eq. 8, 9) while training, in place of the game's own."""
    evaluations: int = 40
    """Greedy evaluations in the course of the stage, evenly spaced."""
    evaluation_games: int = 1000
    """Games in each evaluation, always from the same starts."""
    snapshots: int = 1
    """Times at which its agents are saved, evenly spaced over the stage; the last is its end."""
    time_limit: int | None = None
    """Time limit of games of training [steps]; None for that of the game. Evaluations keep the
    game's.
    """
    limit_terminates: bool = False
    """True for games of training that end with the time limit: no value is bootstrapped from their
    last state.
    """
    randomise: tuple[Spread, ...] = ()
    """Numbers of the robots, their sensors and drives that each game draws while training."""

    def __post_init__(self) -> None:
        require_positive(self, "evaluations", "evaluation_games")
        GAMES.require("evaluation_games", self.evaluation_games)
        require_within(self, 1, 2**30 - 1, "env_steps")  # as the counter can hold
        require_within(self, 0, 10**9, "progress", "failure")
        require_within(self, 0, 1, "pursuer_epsilon", "evader_epsilon")
        require_within(self, 1, 100, "snapshots")
        if self.time_limit is not None:
            require_within(self, 1, MAX_STEPS, "time_limit")

    @property
    def roles(self) -> tuple[Role, ...]:
        """The sides that learn."""
        return tuple(Role)

    @property
    def opponent_names(self) -> tuple[str, ...]:
        """The opponents in evaluations; none where both sides learn."""
        return ()

    @property
    def epsilon(self) -> BySide[float]:
        """Share of random actions of either side when the stage begins, if it learns."""
        return BySide(self.pursuer_epsilon, self.evader_epsilon)

    @abstractmethod
    def agent_kind(self, is_first: bool) -> str:
        """Return the name of its agents after their side, as in P_curriculum; a stage that
        `is_first` begins from random weights.
        """

    def check(self, algorithm: Algorithm, game: Game) -> None:
        """Refuse, by InvalidInput, an algorithm and a game in which the stage cannot be trained."""
        bound = f"an algorithm of another kind for a stage '{self.kind}'"
        require(isinstance(algorithm, self.algorithm_class), "algorithm", algorithm.kind, bound)
        for role in self.roles:
            require_reward_in_play(game, role)

    def loss_value(self, algorithm: Algorithm) -> float | None:
        """Return the value of a lost game in the units of its networks; None where nobody knows it
        before the stage is made.
        """
        return algorithm.loss_value(self.failure)

    def games_to_solve(self, game: Game) -> list[tuple[Game, tuple[int, ...] | None]]:
        """Return the games whose tables the stage needs, each with the numbers of nodes of its
        grid, None for the usual ones.
        """
        return []

    def require_players(self, game: Game) -> None:
        """Refuse, by InvalidInput, players that cannot be found."""

    @abstractmethod
    def make(self, algorithm: Any, game: Game, folder: Path | None = None) -> "Stage":
        """Make the stage in a game, with its opponents; tables of solved games lie in the
        folder.
        """

    def game_of_training(self, game: Game) -> Game:
        """Return the game of this stage's training: with its reward weights and time limit, and the
        robots it draws.
        """
        reward = replace(game.reward, progress=self.progress, failure=self.failure)
        max_steps = game.max_steps if self.time_limit is None else self.time_limit
        trained = replace(game, reward=reward, max_steps=max_steps)
        return randomised(trained, self.randomise) if self.randomise else trained

    def chunks(self, algorithm: Algorithm) -> int:
        """Count the compiled calls in the whole stage."""
        return -(-self.env_steps // algorithm.env_steps_per_chunk)

    def share(self, algorithm: Algorithm, env_steps: int) -> float:
        """Return the share of the stage's updates that is made after some env steps."""
        total = self.chunks(algorithm) * algorithm.env_steps_per_chunk
        idle = algorithm.steps_before_learning
        idle = idle if idle < total else 0
        return max(0, env_steps - idle) / (total - idle)


class Metrics(eqx.Module):
    """Sums over a chunk: finished games by outcome, their returns, and each learner's losses and
    number of updates.

    The return of a team is the mean of its robots'.
    """

    outcomes: Int[Array, " outcomes"]
    returns: BySide[Scalar]
    losses: BySide[Scalar]
    updates: Int[Array, ""]


class TrainState(eqx.Module):
    """State of a stage under training.

    `key` is folded with the number of iterations, never replaced. `env_steps` counts steps of
    single games. A side that learns alone has games in each of its tasks.
    """

    games: Any
    learners: dict[Role, LearningSide[Any]]
    key: PRNGKeyArray
    iterations: Int[Array, ""]
    env_steps: Int[Array, ""]
    episodes: Int[Array, ""]

    def iteration_key(self, use: int) -> PRNGKeyArray:
        """Return the key of one use in this iteration."""
        return jax.random.fold_in(jax.random.fold_in(self.key, use), self.iterations)


S = TypeVar("S", bound=TrainState)
NO_NETWORKS: BySide[Network | None] = BySide(None, None)
"""Both sides start from random weights."""


def zero_counters() -> dict[str, Int[Array, ""]]:
    """Return the counters of a `TrainState` before the first step."""
    names = ("iterations", "env_steps", "episodes")
    return {name: jnp.zeros((), jnp.int32) for name in names}


class Stage(eqx.Module):
    """A stage in its game, with its opponents.

    Attributes:
        config: its numbers.
        algorithm: how sides learn.
        evaluation_game: the game of evaluations, with the run's own rewards.
    """

    config: eqx.AbstractVar[Any]
    algorithm: eqx.AbstractVar[Any]
    evaluation_game: eqx.AbstractVar[Game]

    @abstractmethod
    def init(self, key: PRNGKeyArray, networks: BySide[Network | None] = NO_NETWORKS) -> Any:
        """Return the state before the first step. The key is consumed.

        Sides that learn go on from their networks, or start from random weights.
        """

    @abstractmethod
    def step(self, state: Any) -> tuple[Any, Metrics]:
        """Train one chunk, a compiled call. The state is consumed: replay buffers are updated in
        place.
        """

    @property
    @abstractmethod
    def opponents(self) -> Pool | None:
        """The opponents in evaluations; None where both sides learn."""

    @property
    def clearance_margin(self) -> float:
        """Clearance after braking [m] that its agents keep, or 0."""
        return 0.0

    @property
    def loss_value(self) -> float | None:
        """Value of a lost game in the units of its networks, if they have one."""
        value: float | None = self.config.loss_value(self.algorithm)
        return value

    @property
    def chunks(self) -> int:
        """Compiled calls in the whole stage."""
        return self.config.chunks(self.algorithm)

    def agents(self, state: Any) -> dict[Role, Network]:
        """Return the networks that play where it counts."""
        return {role: side.learner.average for role, side in state.learners.items()}

    def evaluate(self, state: Any) -> dict[str, int]:
        """Count the outcomes of greedy games from fixed starts, with fixed players for a side that
        does not learn.
        """
        agents = self.agents(state)

        def players(role: Role) -> Pool:
            if role in agents:
                policy = greedy_policy(agents[role], self.clearance_margin, self.loss_value)
                return single_player(policy)
            assert self.opponents is not None
            return self.opponents

        start_key, play_key = jax.random.split(jax.random.key(_EVALUATION_SEED))
        starts = sample_starts(self.evaluation_game, start_key, self.config.evaluation_games)
        results = play_out(self.evaluation_game, ROLES.map(players), starts, play_key)
        return counts_by_name(np.bincount(np.asarray(results.outcome), minlength=len(Outcome)))

    def evaluates(self, before: int, after: int) -> bool:
        """Check whether one of the stage's evaluations is in the chunks (before, after]."""
        times = self.config.evaluations
        return after * times // self.chunks > before * times // self.chunks

    def is_better(self, outcomes: dict[str, int], best: dict[str, int] | None) -> bool:
        """Check whether agents with these outcomes are kept in place of the best so far; elsewhere
        the last ones count.
        """
        return False


def end_iteration(
    state: S,
    games: Any,
    played: Transition,
    env_steps: Int[Array, ""],
    learners: Mapping[Role, tuple[LearningSide[Any], Scalar]],
) -> tuple[S, Metrics]:
    """Return the state after an iteration, and its metrics.

    Args:
        state: the state before.
        games: the games under way after it.
        played: its transitions.
        env_steps: env steps of the stage after it.
        learners: each learning side after it, with the losses of its updates, added up.
    """
    first = min(learners)
    after = replace(
        state,
        games=games,
        learners={role: side for role, (side, _) in learners.items()},
        iterations=state.iterations + 1,
        env_steps=env_steps,
        episodes=state.episodes + jnp.sum(played.ended.astype(jnp.int32)),
    )

    def ended_as(outcome: Outcome) -> Int[Array, ""]:
        return jnp.sum((played.ended & (played.outcome == outcome)).astype(jnp.int32))

    def sum_of_ended(returns: Array) -> Scalar:
        of_side = returns if returns.ndim == 2 else jnp.mean(returns, axis=2)
        return jnp.sum(jnp.where(played.ended, of_side, 0.0))

    return after, Metrics(
        outcomes=jnp.stack([ended_as(outcome) for outcome in Outcome]),
        returns=played.sides.map(lambda side: sum_of_ended(side.episode_return)),
        losses=ROLES.map(lambda role: learners[role][1] if role in learners else jnp.zeros(())),
        updates=after.learners[first].learner.updates - state.learners[first].learner.updates,
    )
