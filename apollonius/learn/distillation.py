"""Distillation: one side learns a teacher's action values, in the states of its own games (DAgger).

The student plays, greedy but for some random actions, against several opponents; among them some
that know it and search (`solve.players`). The teacher labels these states and others, and the
network is fitted to the labels (Ross, Gordon, Bagnell, "A reduction of imitation learning and
structured prediction to no-regret online learning", 2011; Rusu et al., "Policy distillation",
2016).
"""

import functools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from apollonius.agents.network import Network, QNetwork
from apollonius.agents.policy import AbstractActionValuePolicy, AbstractPolicy
from apollonius.agents.pool import AbstractPlayers, PartitionedPlayers, single_player
from apollonius.agents.source import NamedPlayer
from apollonius.agents.trained import greedy_policy
from apollonius.agents.wrappers.action_repeat import ActionRepeat
from apollonius.arenas.suite import single_arena_games
from apollonius.catalogue import TABLE, loss_value
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, BySide, Role, Scalar
from apollonius.io.errors import require, require_positive, require_within
from apollonius.learn.algorithm import Algorithm, LearningSide, interpolate_linearly
from apollonius.learn.dqn import DQNConfig, DQNLearner, adam_step
from apollonius.learn.one_side import (
    LineUp,
    OneSideConfig,
    OneSideStage,
    Players,
    equal_parts,
    resolve_players,
)
from apollonius.learn.replay_buffer import ReplayBuffer, add
from apollonius.learn.stage import NO_NETWORKS, Metrics, TrainState, end_iteration, zero_counters
from apollonius.learn.states_to_label import starts_of, states_to_label
from apollonius.learn.teacher import Clearance, DistillationTask, motion_of_clearance
from apollonius.observe.observation import observation_rows
from apollonius.play.rollout import Games, collect, init_games
from apollonius.solve.grid import make_grid
from apollonius.solve.players import RolloutSearch, SaddlePolicy
from apollonius.solve.safety import solve_safety
from apollonius.solve.solving import cached_tables, reference_grid

TABLES = "tables"
"""Folder of solved games in that of a run."""
ORDER = 10.0
"""Weight of the differences between a state's actions, relative to their mean: the choice depends
on them alone.
"""
_PLANS = ((10, 1, NUM_ACTIONS), (10, 2, 3))
"""Plans of near-sighted and far-sighted attackers: steps of a hold, holds, and plans that are
followed further; one and two seconds, in a game with steps of 0.1 s.
"""


class Labels(eqx.Module):
    """Observations, and the teacher's values of the nine actions there, NaN where there is nothing
    to learn.
    """

    observation: Float[Array, "rows size"]
    values: Float[Array, "rows 9"]


@dataclass(frozen=True)
class DistillationConfig(OneSideConfig):
    """One side learns a teacher's action values, in the states of its own games."""

    algorithm_class = DQNConfig
    kind: Literal["distillation"] = "distillation"
    env_steps: int = 50_000_000
    pursuer_epsilon: float = 0.04
    """Share of random actions of a learning pursuer, each held for a round; constant."""
    evader_epsilon: float = 0.04
    """Share of random actions of a learning evader, each held for a round; constant."""
    teacher: str = TABLE
    """Source of the action values: `table`, the player by the game solved for that side, or an
    agent trained by DQN.
    """
    opponents: tuple[str, ...] = (TABLE, "random", "pursuer", "P_curriculum", "intercept")
    """Its opponents, each in an equal part of the games that attackers leave: `table` is the other
    side's.
    """
    near_sighted: int = 192
    """Games against an attacker that knows the student and looks one hold of ten steps ahead."""
    far_sighted: int = 64
    """Games against one that looks two holds ahead, at four times the cost."""
    grid: tuple[int, ...] | None = None
    """Nodes along x, y, v and heading on which the game is solved; None for those of `apollonius
    solve game`.
    """
    clearance: float = 0.05
    """Clearance [m] below which labels weigh it against the teacher's values; 0 ignores clearance.
    """
    updates: int = 8
    """Updates in a round."""
    informed: float = 3.0
    """Time since a side with sensors saw an opponent [s] up to which it learns what its teacher,
    who sees it, does.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "updates")
        require_within(self, 0, 10**9, "clearance", "near_sighted", "far_sighted", "informed")
        bound = "left out: tables know the rules' own robots only"
        require(not (self.randomise and self.solves), "randomise", "some numbers", bound)
        require(
            self.grid is None or len(self.grid) == 4,
            "grid",
            self.grid,
            "four numbers of nodes, or left out",
        )

    def agent_kind(self, is_first: bool) -> str:
        return "distilled"

    def check(self, algorithm: Algorithm, game: Game) -> None:
        """Refuse fewer games than opponents, and tables of other games than those of two, too."""
        super().check(algorithm, game)
        if self.solves:
            game.require_two("a distillation by tables")
        attackers = self.near_sighted + self.far_sighted
        bound = f"more than the {attackers} of its attackers, so that each opponent has one"
        has_room = algorithm.games - attackers >= len(self.opponents)
        require(has_room, "games", algorithm.games, bound)

    def games_to_solve(self, game: Game) -> list[tuple[Game, tuple[int, ...] | None]]:
        if not self.solves:
            return []
        return [(alone, self.grid) for alone in single_arena_games(game)]

    def make(self, algorithm: DQNConfig, game: Game, folder: Path | None = None) -> "Distillation":
        tasks = distillation_tasks(self, game, folder and folder / TABLES)
        first = tasks[0].game
        if self.solves:  # in the arena of the first tables
            evaluation_game = replace(first, reward=game.reward, max_steps=game.max_steps)
        else:
            evaluation_game = replace(game, chart=first.chart)
        return Distillation(self, algorithm, evaluation_game, tuple(tasks))

    def loss_value(self, algorithm: Algorithm) -> None:
        """Return None: a student values games in its teacher's units."""
        return

    def line_ups(self, game: Game) -> list[LineUp]:
        return [
            (task_game, names | {self.side: (self.teacher,)})
            for task_game, names in super().line_ups(game)
        ]

    @property
    def solves(self) -> bool:
        """True if somebody needs the tables of solved games."""
        searches = self.near_sighted + self.far_sighted + self.clearance > 0
        return searches or TABLE in (self.teacher, *self.opponents)


class Distillation(OneSideStage[DistillationTask]):
    """A distillation in its games, with its opponents and the teacher."""

    config: DistillationConfig = eqx.field(static=True)
    algorithm: DQNConfig = eqx.field(static=True)
    evaluation_game: Game
    tasks: tuple[DistillationTask, ...]

    def init(self, key: PRNGKeyArray, networks: BySide[Network | None] = NO_NETWORKS) -> TrainState:
        network_key, start_key, train_key = jax.random.split(key, 3)
        config, algorithm, tasks = self.config, self.algorithm, self.tasks
        learner = algorithm.init_learner(network_key, networks[config.side])
        keys = jax.random.split(start_key, len(tasks))
        first_games = tuple(
            _first_games(config, algorithm, learner.network, task, task_key)
            for task, task_key in zip(tasks, keys, strict=True)
        )
        block = max(
            _rows_per_round(config, task, games)
            for task, games in zip(tasks, first_games, strict=True)
        )
        rows = max(1, algorithm.replay_capacity // block) * block
        size = learner.network.observation.size
        empty = Labels(jnp.zeros((rows, size)), jnp.zeros((rows, NUM_ACTIONS)))
        head, filled = (jnp.zeros((), jnp.int32) for _ in range(2))
        side = LearningSide(learner, ReplayBuffer(empty, head, filled))
        return TrainState(first_games, {config.side: side}, train_key, **zero_counters())

    def train_task(self, state: TrainState, task: DistillationTask) -> tuple[TrainState, Metrics]:
        return train_task_chunk(self.config, self.algorithm, state, task)

    @property
    def loss_value(self) -> float:
        return float(self.tasks[0].loss_value)


def distillation_tasks(
    config: DistillationConfig, game: Game, folder: Path | None
) -> list[DistillationTask]:
    """Return the tasks of a run: one, or where tables are needed one in each arena.

    Games are solved whose tables do not lie in the folder. The tasks in all arenas have one shape,
    so that one compilation serves all. Raises InvalidInput when a player cannot be teacher,
    the teacher does not value the nine actions, or robots of a solved game are of several kinds.
    """
    role, scenario = config.side, game.scenario
    ((_, names),) = config.line_ups(game)
    if not config.solves:
        task_game, players = resolve_players(config.game_of_training(game), names)
        return [_distillation_task(config, players, task_game, None)]
    kinds = "robots of several kinds"
    require(
        scenario is None or scenario.kinds is None,
        "game",
        kinds,
        "of one kind: the solved game has its robots",
    )
    alone = single_arena_games(game)
    grids = [reference_grid(arena_game, role) for arena_game in alone]
    counts = tuple(np.max([grid.counts for grid, _ in grids], axis=0).tolist())

    def task_in(number: int, arena_game: Game) -> DistillationTask:
        one_arena = game if scenario is None else game.with_variant(jnp.asarray(number))
        task_game, players = resolve_players(config.game_of_training(one_arena), names)
        tables = cached_tables(arena_game, config.grid, folder, played=task_game)
        players |= {(TABLE, side): NamedPlayer(TABLE, tables[side]) for side in Role}
        task = _distillation_task(config, players, task_game, tables[role.other])
        if config.clearance == 0:
            return task
        grid = make_grid(task_game.arena, task_game.body(role), counts)
        safety = solve_safety(task_game, role, grid, grids[0][1])
        return replace(
            task,
            clearance=Clearance(
                motion_of_clearance(task_game, role), grid, safety.table, config.clearance
            ),
        )

    return [task_in(number, arena_game) for number, arena_game in enumerate(alone)]


def _distillation_task(
    config: DistillationConfig, players: Players, game: Game, table: SaddlePolicy | None
) -> DistillationTask:
    teacher, other = players[config.teacher, config.side], config.side.other
    policy, bound = (
        teacher.policy,
        "one that values the nine actions: table, or an agent trained by DQN",
    )
    require(isinstance(policy, AbstractActionValuePolicy), "teacher", config.teacher, bound)
    assert isinstance(policy, AbstractActionValuePolicy)
    opponents = tuple(players[name, other].policy for name in config.opponents)
    return DistillationTask(game, opponents, policy, loss_value(teacher, game), None, table)


def _rows_per_round(config: DistillationConfig, task: DistillationTask, games: Games) -> int:
    """Count the states that are labelled in a round."""
    label = functools.partial(states_to_label, config.side, config.informed)
    _, _, learns = jax.eval_shape(label, task, games, jax.random.key(0))
    return len(learns)


@functools.partial(jax.jit, static_argnames=("config", "algorithm"))
def _first_games(
    config: DistillationConfig,
    algorithm: DQNConfig,
    network: QNetwork,
    task: DistillationTask,
    key: PRNGKeyArray,
) -> Games:
    bits = jnp.zeros((2, algorithm.games), jnp.uint32)
    starts = starts_of(task, algorithm.games, key)
    return init_games(task.game, starts, _players(config, algorithm, network, task, key), bits)


@functools.partial(jax.jit, static_argnames=("config", "algorithm"), donate_argnames="state")
def train_task_chunk(
    config: DistillationConfig, algorithm: DQNConfig, state: TrainState, task: DistillationTask
) -> tuple[TrainState, Metrics]:
    """Train one chunk in one task, whose games are played on. The state is consumed."""

    def iterate(state: TrainState, _: None) -> tuple[TrainState, Metrics]:
        return _iterate(config, algorithm, state, task)

    after, metrics = jax.lax.scan(iterate, state, None, algorithm.iterations_per_chunk)
    return after, jax.tree.map(lambda leaf: jnp.sum(leaf, axis=0), metrics)


def _iterate(
    config: DistillationConfig, algorithm: DQNConfig, state: TrainState, task: DistillationTask
) -> tuple[TrainState, Metrics]:
    """Ask the teacher, play some steps of every game, fit the student."""
    role, game = config.side, task.game
    side = state.learners[role]
    key = jax.random.fold_in(state.key, state.iterations)
    label_key, player_key, play_key, start_key, learn_key = jax.random.split(key, 5)
    network = side.learner.network
    knowledge, states, learns = states_to_label(role, config.informed, task, state.games, label_key)
    _, observations = observation_rows(network.observation, game, knowledge, role)
    values = jnp.where(learns[:, None], task.values(states, role), jnp.nan)
    buffer = add(side.buffer, Labels(observations, values))
    starts = jax.tree.map(lambda leaf: leaf[None], starts_of(task, algorithm.games, start_key))
    players = _players(config, algorithm, network, task, player_key)
    games, played = collect(
        game, players, state.games, starts, play_key, algorithm.steps_per_iteration
    )
    env_steps = state.env_steps + algorithm.env_steps_per_iteration
    learner, loss = _fit(config, algorithm, side.learner, buffer, env_steps, learn_key)
    learners = {role: (LearningSide(learner, buffer), loss)}
    return end_iteration(state, games, played, env_steps, learners)


def _players(
    config: DistillationConfig,
    algorithm: DQNConfig,
    network: QNetwork,
    task: DistillationTask,
    key: PRNGKeyArray,
) -> BySide[AbstractPlayers]:
    """Return the student, whose random actions last for a round, and its opponents, each in games
    of its own.
    """
    games, table = algorithm.games, task.table
    robots = len(task.game.bodies[config.side])
    explorer = algorithm.explorer(network, jnp.float32(config.epsilon[config.side]))
    bits = jax.random.bits(key, (games * robots,), jnp.uint32)
    student = replace(single_player(explorer), bits=bits)
    players: list[AbstractPolicy] = [*task.opponents]
    if table is not None:
        searches = (
            RolloutSearch(table.zero_sum_game, table.table, greedy_policy(network), *ahead)
            for ahead in _PLANS
        )
        players += [ActionRepeat(search, algorithm.steps_per_iteration) for search in searches]
    left = games - config.near_sighted - config.far_sighted
    shares = [*equal_parts(left, len(task.opponents)), config.near_sighted, config.far_sighted]
    opponents = [pair for pair in zip(players, shares, strict=False) if pair[1]]
    partitioned = PartitionedPlayers(*map(tuple, zip(*opponents, strict=True)))
    return BySide[AbstractPlayers].of(config.side, student, partitioned)


def _fit(
    config: DistillationConfig,
    algorithm: DQNConfig,
    learner: DQNLearner,
    buffer: ReplayBuffer[Labels],
    env_steps: Int[Array, ""],
    key: PRNGKeyArray,
) -> tuple[DQNLearner, Scalar]:
    """Make some updates from the labels; return their losses, added up."""
    rate = interpolate_linearly(
        algorithm.learning_rate, algorithm.final_learning_rate, config.env_steps, env_steps
    )

    def update(learner: DQNLearner, key: PRNGKeyArray) -> tuple[DQNLearner, Scalar]:
        rows = jax.random.randint(key, (algorithm.batch,), 0, buffer.filled)
        labels = jax.tree.map(lambda leaf: leaf[rows], buffer.rows)
        value, gradient = eqx.filter_value_and_grad(_error)(learner.network, labels)
        return adam_step(learner, gradient, rate, algorithm.averaging), value

    learner, losses = jax.lax.scan(update, learner, jax.random.split(key, config.updates))
    return learner, jnp.sum(losses)


def _error(network: QNetwork, labels: Labels) -> Scalar:
    """Return the mean squared error of the differences between a state's actions, and of their
    mean.
    """
    wrong = jnp.where(
        jnp.isnan(labels.values), 0.0, network.batch(labels.observation) - labels.values
    )
    mean = jnp.mean(wrong, axis=1)
    return ORDER * jnp.mean(jnp.sum((wrong - mean[:, None]) ** 2, axis=1)) + jnp.mean(mean**2)
