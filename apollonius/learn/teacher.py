"""The teacher of a distillation: values of the nine actions, and the clearance that they leave."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from apollonius.agents.kind import Named
from apollonius.agents.policy import AbstractActionValuePolicy, AbstractPolicy
from apollonius.arenas.charting import charted, largest_radius
from apollonius.arenas.suite import each_alone
from apollonius.catalogue import TABLE, find_player, price_of_losing
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, GameState, Real, RobotState, Role, Scalar
from apollonius.io.errors import require
from apollonius.learn.config import RunConfig
from apollonius.learn.stage_config import DistillationConfig, Task
from apollonius.observe.observation import perceive
from apollonius.observe.registry import find_observation
from apollonius.solve.grid import Grid, make_grid
from apollonius.solve.motion import Motion, last, motion_of
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.safety import solve_safety
from apollonius.solve.solving import cached_tables, reference_grid

TABLES = "tables"
"""Folder of the solved game in that of a run."""
_AHEAD = 2
"""Steps of an action after which the clearance is looked up."""
DEEPEST = 0.3
"""Largest difference to the best action, before clearance counts: capacity spent on how bad a bad action is would be
lost to the choice between good ones."""
STEEPNESS = 10.0
"""Cost of a missing metre of clearance."""
COSTLIEST = 0.8
"""Largest cost of missing clearance."""


class Clearance(eqx.Module):
    """The cost of missing clearance, of what is `wanted` [m] after `_AHEAD` steps, by the table of `solve_safety`."""

    motion: Motion
    grid: Grid
    table: Float[Array, "v heading x y"]
    wanted: Real

    def after(self, robot: RobotState, actions: Int[Array, " actions"]) -> Float[Array, " actions"]:
        """Return the clearance [m] that can be kept for ever after each action."""

        def clearance(action: Int[Array, ""]) -> Scalar:
            course = self.motion.hold(robot, action)
            return jnp.minimum(self.motion.clearance(course), self.grid.interpolate(self.table, last(course)))

        return jax.vmap(clearance)(actions)

    def weighed(self, behind: Float[Array, "9"], robot: RobotState) -> Float[Array, "9"]:
        """Return the differences to the best action, less the cost of missing clearance.

        As clearance runs out, the given differences fade, and clearance alone decides in the end: a wall is reached by
        many steps, none of which leaves much less clearance than another would.
        """
        left = jnp.minimum(self.after(robot, jnp.arange(NUM_ACTIONS)), self.wanted)
        most = jnp.max(left)
        ease = jnp.clip(most / self.wanted, 0.0, 1.0)
        return ease * behind - jnp.minimum(STEEPNESS * (most - left), COSTLIEST)


class Teacher(eqx.Module):
    """A player that values all nine actions, and the clearance that they leave to the student's robot, or None.

    A lost game has the price `scale` in its values, and `unit` in the student's.
    """

    policy: AbstractActionValuePolicy
    scale: Real
    unit: Real
    clearance: Clearance | None

    def values(self, game: Game, states: GameState, role: Role) -> Float[Array, "games 9"]:
        """Return one side's values of the nine actions in states, leaves `[games]`; the best has the player's value, in
        the student's unit."""
        read, rows = perceive(self.policy.observation, game, states, role)
        bits = jnp.zeros((), jnp.uint32)
        values = jax.vmap(lambda row: self.policy.weigh(read(row), self.policy.memory, bits)[0])(rows)
        best = jnp.max(values, axis=1, keepdims=True)
        behind = jnp.maximum((values - best) / self.scale, -DEEPEST)
        if self.clearance is not None:
            behind = jax.vmap(self.clearance.weighed)(behind, states.robots[role][0])
        return best * (self.unit / self.scale) + self.unit * (behind - jnp.max(behind, axis=1, keepdims=True))


class Setting(eqx.Module):
    """The game, the teacher there, and the student's opponents, of equal parts of the games that attackers leave.

    Attackers look ahead by a table, the other side's player by the game solved in this one arena, if there are any.
    """

    game: Game
    teacher: Teacher
    opponents: tuple[AbstractPolicy, ...]
    table: SaddlePolicy | None


def make_settings(config: RunConfig, game: Game, folder: Path | None) -> list[Setting]:
    """Return the settings of a run: one for each task, or where tables are needed one in each arena.

    Games are solved whose tables do not lie in the folder. The settings of all arenas have one shape, so that one
    compilation serves all. Raises InvalidInput when a player cannot be found, the teacher does not value the nine
    actions, or robots of a solved game are of several kinds.
    """
    stage, role, scenario = config.distillation, config.distillation.side, game.scenario
    reads, bound = config.learner.observation, "egocentric or team, which know the room to brake, or no caution"
    require(stage.caution == 0 or find_observation(reads).charted, "observation", reads, bound)
    if not stage.solves:
        return _task_settings(config, game)
    kinds = "robots of several kinds"
    require(scenario is None or scenario.kinds is None, "game", kinds, "of one kind: the solved game has its robots")
    alone = each_alone(game)
    grids = [reference_grid(one, role) for one in alone]
    counts = tuple(np.max([grid.counts for grid, _ in grids], axis=0).tolist())

    def setting(number: int, one: Game) -> Setting:
        here = game if scenario is None else game.in_place(jnp.asarray(number))
        here, players = _cast(stage, here)
        tables = cached_tables(one, stage.grid, folder, played=here)
        players |= {(TABLE, side): Named(TABLE, tables[side]) for side in Role}
        found = _setting(stage, players, here, tables[role.other])
        if stage.clearance == 0:
            return found
        grid = make_grid(here.arena, here.body(role), counts)
        safety = solve_safety(here, role, grid, grids[0][1])
        clearance = Clearance(motion_of(here, role, _AHEAD), grid, safety.table, stage.clearance)
        return replace(found, teacher=replace(found.teacher, clearance=clearance))

    return [setting(number, one) for number, one in enumerate(alone)]


def _task_settings(config: RunConfig, game: Game) -> list[Setting]:
    """Return the settings of the run's own game and of the further tasks, all in the unit of the first teacher."""
    stage, settings, known = config.distillation, list[Setting](), list[Game]()
    for task in (Task(game, stage.teacher), *stage.tasks):
        known.append(_charted_as(task.game, known, find_observation(config.learner.observation).charted))
        asked = replace(stage, teacher=task.teacher, opponents=task.opponents or stage.opponents, tasks=())
        here, players = _cast(asked, stage.trained_in(known[-1]))
        settings.append(_setting(asked, players, here, None))
    unit = settings[0].teacher.unit
    return [replace(one, teacher=replace(one.teacher, unit=unit)) for one in settings]


def _charted_as(game: Game, others: Sequence[Game], are_read: bool) -> Game:
    """Return a game with the charts of another one in the same arenas and with as large robots, or with its own."""
    for other in others:
        ours, theirs = game.scenario, other.scenario
        if ours and theirs and ours.name and ours.name == theirs.name and largest_radius(game) == largest_radius(other):
            return replace(game, scenario=replace(ours, arenas=theirs.arenas))
    return charted(game, are_read)


Players = dict[tuple[str, Role], Named]
"""The players of a setting, by name and side."""


def _cast(stage: DistillationConfig, game: Game) -> tuple[Game, Players]:
    """Return a game, with charts where its players read them, and these."""
    named = {(name, stage.side.other) for name in stage.opponents} | {(stage.teacher, stage.side)}
    players = {each: find_player(*each, game) for each in named if each[0] != TABLE}
    return charted(game, any(player.policy.charted for player in players.values())), players


def _setting(stage: DistillationConfig, players: Players, game: Game, table: SaddlePolicy | None) -> Setting:
    found = players[stage.teacher, stage.side]
    policy, bound = found.policy, "one that values the nine actions: table, or an agent trained by DQN"
    require(isinstance(policy, AbstractActionValuePolicy), "teacher", stage.teacher, bound)
    assert isinstance(policy, AbstractActionValuePolicy)
    price = price_of_losing(found, game)
    opponents = tuple(players[name, stage.side.other].policy for name in stage.opponents)
    return Setting(game, Teacher(policy, price, price, None), opponents, table)
