"""A best response: one side learns by proximal policy optimisation against others that do not
learn, in one or several games.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from apollonius.agents.network import Network, QNetwork, interpolate_weights
from apollonius.agents.pool import AbstractPlayers, PartitionedPlayers, single_player
from apollonius.arenas.charting import largest_radius, with_chart
from apollonius.catalogue import TABLE
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import BySide, Role
from apollonius.io.errors import require, require_within
from apollonius.learn.algorithm import Algorithm, LearningSide
from apollonius.learn.one_side import (
    LineUp,
    OneSideConfig,
    OneSideStage,
    TrainingTask,
    equal_parts,
    resolve_players,
)
from apollonius.learn.ppo import PPOConfig
from apollonius.learn.replay_buffer import rows_of
from apollonius.learn.restarts import GamesAndLosses, add_losses, empty_restarts, mix_in_restarts
from apollonius.learn.stage import NO_NETWORKS, Metrics, TrainState, end_iteration, zero_counters
from apollonius.observe.registry import find_observation
from apollonius.play.rollout import collect, init_games

_STARTS = 8
"""Starts of each column of games in a round; shorter games begin from some again."""


@dataclass(frozen=True)
class Task:
    """A further game of a response, with as many opponents as its stage, or with the same."""

    game: Game
    opponents: tuple[str, ...] = ()


@dataclass(frozen=True)
class ResponseConfig(OneSideConfig):
    """One side learns a best response by proximal policy optimisation, in one or several games."""

    algorithm_class = PPOConfig
    kind: Literal["response"] = "response"
    env_steps: int = 16_000_000
    progress: float = 0.0
    failure: float = 15.0
    tasks: tuple[Task, ...] = ()
    """Further games, which take turns with the run's own."""
    restart_fraction: float = 0.0
    """Share of games that begin in a state from which a game was lost within a round. Where few
    games are lost, most games teach nothing (Florensa et al., "Reverse curriculum generation for
    reinforcement learning", 2017, begin near the goal).
    """
    initial_weight_share: float = 0.0
    """Share of its first network in the weights of the agent, which then forgets less (Wortsman et
    al., "Robust fine-tuning of zero-shot models", 2022).
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        require_within(self, 0, 1, "restart_fraction", "initial_weight_share")
        alike = all(len(task.opponents) in (0, len(self.opponents)) for task in self.tasks)
        bound = f"{len(self.opponents)} names, as those of the stage, or left out"
        require(alike, "tasks: opponents", "given", bound)
        names = *self.opponents, *(name for task in self.tasks for name in task.opponents)
        require(TABLE not in names, "opponents", TABLE, "players that need no solved game")

    def agent_kind(self, is_first: bool) -> str:
        return "response"

    def line_ups(self, game: Game) -> list[LineUp]:
        tasks = Task(game), *self.tasks
        return [(task.game, {self.side.other: task.opponents or self.opponents}) for task in tasks]

    def check(self, algorithm: Algorithm, game: Game) -> None:
        """Refuse fewer games than opponents, too, and a task in which it cannot be trained."""
        for task_game in (game, *(task.game for task in self.tasks)):
            super().check(algorithm, task_game)
        bound = "as many at least as opponents, so that each has one"
        require(algorithm.games >= len(self.opponents), "games", algorithm.games, bound)

    def make(self, algorithm: PPOConfig, game: Game, folder: Path | None = None) -> "Response":
        tasks = training_tasks(self, algorithm, game)
        evaluation_game = replace(game, chart=tasks[0].game.chart)
        return Response(replace(self, tasks=()), algorithm, evaluation_game, tuple(tasks))


def training_tasks(config: ResponseConfig, algorithm: PPOConfig, game: Game) -> list[TrainingTask]:
    """Return the run's own game and the further tasks; raises InvalidInput when an opponent cannot
    be found.
    """
    needs_chart = find_observation(algorithm.observation).needs_chart
    charted_games = list[Game]()
    tasks = list[TrainingTask]()
    for game_of_task, names in config.line_ups(game):
        charted = _with_chart_like(game_of_task, charted_games, needs_chart)
        charted_games.append(charted)
        task_game, players = resolve_players(config.game_of_training(charted), names)
        other = config.side.other
        opponents = tuple(players[name, other].policy for name in names[other])
        tasks.append(TrainingTask(task_game, opponents))
    return tasks


def _with_chart_like(game: Game, references: Sequence[Game], needs_chart: bool) -> Game:
    """Return a game with the charts of another one in the same arenas and with as large robots, or
    with its own.
    """
    for other in references:
        scenario, charted = game.scenario, other.scenario
        if scenario is None or charted is None or not scenario.name:
            continue
        same_size = largest_radius(game) == largest_radius(other)
        if scenario.name == charted.name and same_size:
            return replace(game, chart=other.chart)
    return with_chart(game, needs_chart)


class ResponseState(TrainState):
    """State of a response; `first` is the network that it began with, where its weights are
    mixed into the agent's.
    """

    first: QNetwork | None = None


class Response(OneSideStage[TrainingTask]):
    """A response in its games, with its opponents."""

    config: ResponseConfig = eqx.field(static=True)
    algorithm: PPOConfig = eqx.field(static=True)
    evaluation_game: Game
    tasks: tuple[TrainingTask, ...]

    def init(
        self, key: PRNGKeyArray, networks: BySide[Network | None] = NO_NETWORKS
    ) -> ResponseState:
        network_key, critic_key, start_key, train_key = jax.random.split(key, 4)
        side = self.config.side
        learner = self.algorithm.init_learner(network_key, critic_key, networks[side])
        keys = jax.random.split(start_key, len(self.tasks))
        first_games = tuple(
            _first_games(self.config, self.algorithm, learner.network, task, task_key)
            for task, task_key in zip(self.tasks, keys, strict=True)
        )
        mixes = self.config.initial_weight_share > 0
        return ResponseState(
            first_games,
            {side: LearningSide(learner)},
            train_key,
            **zero_counters(),
            first=jax.tree.map(jnp.copy, learner.network) if mixes else None,
        )

    def train_task(self, state: ResponseState, task: TrainingTask) -> tuple[ResponseState, Metrics]:
        return train_round(self.config, self.algorithm, state, task)

    def agents(self, state: ResponseState) -> dict[Role, Network]:
        """Return the network of the side that learns, mixed with its first one."""
        network = state.learners[self.config.side].learner.average
        if state.first is not None:
            share = self.config.initial_weight_share
            network = interpolate_weights(network, state.first, share)
        return {self.config.side: network}


def _players(
    config: ResponseConfig, algorithm: PPOConfig, network: QNetwork, task: TrainingTask
) -> BySide[AbstractPlayers]:
    """Return the learner and its opponents, each in games of its own."""
    games = equal_parts(algorithm.games, len(task.opponents))
    learner = single_player(algorithm.sampler(network, config.clearance_margin))
    opponents = PartitionedPlayers(task.opponents, tuple(games))
    return BySide[AbstractPlayers].of(config.side, learner, opponents)


@functools.partial(jax.jit, static_argnames=("config", "algorithm"))
def _first_games(
    config: ResponseConfig,
    algorithm: PPOConfig,
    network: QNetwork,
    task: TrainingTask,
    key: PRNGKeyArray,
) -> GamesAndLosses:
    bits = jnp.zeros((2, algorithm.games), jnp.uint32)
    starts = reset_batch(task.game, key, algorithm.games)
    players = _players(config, algorithm, network, task)
    games = init_games(task.game, starts, players, bits)
    return GamesAndLosses(games, empty_restarts(starts))


@functools.partial(jax.jit, static_argnames=("config", "algorithm"), donate_argnames="state")
def train_round(
    config: ResponseConfig, algorithm: PPOConfig, state: ResponseState, task: TrainingTask
) -> tuple[ResponseState, Metrics]:
    """Play a round in one task, and learn from it. The state is consumed."""
    side, game, before = config.side, task.game, state.games
    key = jax.random.fold_in(state.key, state.iterations)
    play_key, start_key, restart_key, learn_key = jax.random.split(key, 4)
    network = state.learners[side].learner.network
    drawn = mix_in_restarts(
        config.restart_fraction,
        reset_batch(game, start_key, _STARTS * algorithm.games),
        before.lost_states,
        restart_key,
    )
    starts = jax.tree.map(
        lambda leaf: leaf.reshape(_STARTS, algorithm.games, *leaf.shape[1:]), drawn
    )
    players = _players(config, algorithm, network, task)
    games, played = collect(
        game, players, before.games, starts, play_key, algorithm.steps, with_next_obs=False
    )
    env_steps = state.env_steps + algorithm.env_steps_per_iteration
    rows = rows_of(played, side, config.limit_terminates)
    side_and_error = algorithm.learn(
        state.learners[side],
        replace(rows, reward=rows.reward / algorithm.reward_unit(game)),
        config.env_steps,
        env_steps,
        learn_key,
        config.clearance_margin,
    )
    lost = add_losses(before.lost_states, game, before.games.state, played.outcome, side)
    after = GamesAndLosses(games, lost)
    return end_iteration(state, after, played, env_steps, {side: side_and_error})
