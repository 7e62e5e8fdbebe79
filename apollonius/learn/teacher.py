"""The teacher of a distillation: values of the nine actions, and the clearance that they leave."""

from dataclasses import replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from apollonius.agents.policy import AbstractActionValuePolicy
from apollonius.agents.source import NamedPlayer
from apollonius.arenas.suite import single_arena_games
from apollonius.catalogue import TABLE, loss_value
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, GameState, Real, RobotState, Role, Scalar
from apollonius.io.errors import require
from apollonius.learn.config import RunConfig
from apollonius.learn.stage_config import DistillationConfig
from apollonius.learn.training_task import (
    Players,
    TrainingTask,
    require_room_to_brake,
    resolve_players,
)
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.observation import observation_rows
from apollonius.solve.grid import Grid, make_grid
from apollonius.solve.motion import Motion, end_state, motion_of
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.safety import solve_safety
from apollonius.solve.solving import cached_tables, reference_grid

TABLES = "tables"
"""Folder of the solved game in that of a run."""
_AHEAD = 2
"""Steps of an action, of about 0.1 s, after which the clearance is looked up."""
DEEPEST = 0.3
"""Largest difference to the best action, before clearance counts: capacity spent on how bad a bad
action is would be lost to the choice between good ones.
"""
STEEPNESS = 10.0
"""Cost of a missing metre of clearance, on the scale of the paper's robots."""
COSTLIEST = 0.8
"""Largest cost of missing clearance."""


class Clearance(eqx.Module):
    """The cost of missing clearance, of what is less than the `margin` [m] after `_AHEAD` steps, by
    the table of `solve_safety`.
    """

    motion: Motion
    grid: Grid
    table: Float[Array, "v heading x y"]
    margin: Real

    def after(self, robot: RobotState, actions: Int[Array, " actions"]) -> Float[Array, " actions"]:
        """Return the clearance [m] that can be kept for ever after each action."""

        def clearance(action: Int[Array, ""]) -> Scalar:
            course = self.motion.hold(robot, action)
            return jnp.minimum(
                self.motion.clearance(course), self.grid.interpolate(self.table, end_state(course))
            )

        return jax.vmap(clearance)(actions)

    def weigh_against(self, behind: Float[Array, "9"], robot: RobotState) -> Float[Array, "9"]:
        """Return the differences to the best action, less the cost of missing clearance.

        As clearance runs out, the given differences fade, and clearance alone decides in the end: a
        wall is reached by many steps, none of which leaves much less clearance than another would.
        """
        left = jnp.minimum(self.after(robot, jnp.arange(NUM_ACTIONS)), self.margin)
        most = jnp.max(left)
        ease = jnp.clip(most / self.margin, 0.0, 1.0)
        return ease * behind - jnp.minimum(STEEPNESS * (most - left), COSTLIEST)


class DistillationTask(TrainingTask):
    """A setting with a teacher, which values all nine actions, and the clearance that they leave,
    or None.

    Some games are those of attackers, who look ahead by a table, the other side's player by the
    game solved in this one arena; None without any.
    """

    teacher: AbstractActionValuePolicy
    clearance: Clearance | None
    table: SaddlePolicy | None

    def values(self, states: GameState, role: Role) -> Float[Array, "games 9"]:
        """Return one side's values of the nine actions in states, leaves `[games]`; the best has
        the teacher's own.
        """
        read, rows = observation_rows(
            self.teacher.observation, self.game, Knowledge.complete(states), role
        )
        bits = jnp.zeros((), jnp.uint32)
        values = jax.vmap(lambda row: self.teacher.score(read(row), self.teacher.memory, bits)[0])(
            rows
        )
        best = jnp.max(values, axis=1, keepdims=True)
        behind = jnp.maximum((values - best) / self.loss_value, -DEEPEST)
        if self.clearance is not None:
            behind = jax.vmap(self.clearance.weigh_against)(behind, states.robots[role][0])
        return best + self.loss_value * (behind - jnp.max(behind, axis=1, keepdims=True))


def distillation_tasks(
    config: RunConfig, game: Game, folder: Path | None
) -> list[DistillationTask]:
    """Return the lessons of a run: one, or where tables are needed one in each arena.

    Games are solved whose tables do not lie in the folder. The lessons in all arenas have one
    shape, so that one compilation serves all. Raises InvalidInput when a player cannot be teacher,
    the teacher does not value the nine actions, or robots of a solved game are of several kinds.
    """
    stage = config.distillation
    role = config.distillation.side
    scenario = game.scenario
    require_room_to_brake(stage, config.learner)
    ((_, names),) = stage.line_ups(game)
    if not stage.solves:
        task_game, players = resolve_players(stage.trained_in(game), names)
        return [_distillation_task(stage, players, task_game, None)]
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
        task_game = game if scenario is None else game.with_variant(jnp.asarray(number))
        task_game, players = resolve_players(task_game, names)
        tables = cached_tables(arena_game, stage.grid, folder, played=task_game)
        players |= {(TABLE, side): NamedPlayer(TABLE, tables[side]) for side in Role}
        task = _distillation_task(stage, players, task_game, tables[role.other])
        if stage.clearance == 0:
            return task
        grid = make_grid(task_game.arena, task_game.body(role), counts)
        safety = solve_safety(task_game, role, grid, grids[0][1])
        return replace(
            task,
            clearance=Clearance(
                motion_of(task_game, role, _AHEAD), grid, safety.table, stage.clearance
            ),
        )

    return [task_in(number, arena_game) for number, arena_game in enumerate(alone)]


def _distillation_task(
    stage: DistillationConfig, players: Players, game: Game, table: SaddlePolicy | None
) -> DistillationTask:
    teacher, other = players[stage.teacher, stage.side], stage.side.other
    policy, bound = (
        teacher.policy,
        "one that values the nine actions: table, or an agent trained by DQN",
    )
    require(isinstance(policy, AbstractActionValuePolicy), "teacher", stage.teacher, bound)
    assert isinstance(policy, AbstractActionValuePolicy)
    opponents = tuple(players[name, other].policy for name in stage.opponents)
    return DistillationTask(game, opponents, loss_value(teacher, game), policy, None, table)
