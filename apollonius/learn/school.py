"""Who teaches in a distillation, and whom the student meets."""

from collections.abc import Callable
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from apollonius.agents.kind import Named
from apollonius.agents.policy import AbstractActionValuePolicy, AbstractPolicy
from apollonius.arenas.suite import each_alone
from apollonius.catalogue import TABLE, find_player, price_of_losing
from apollonius.errors import require
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.learn.config import RunConfig
from apollonius.learn.teacher import Room, Teacher
from apollonius.solve.grid import Sweep, make_grid
from apollonius.solve.motion import motion_of
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.safety import solve_safety
from apollonius.solve.solving import kept_tables, reference_grid

TABLES = "tables"
"""The folder of a run in which the solved game lies."""
_AHEAD = 2
"""Steps of an action after which the room is looked at."""


class School(eqx.Module):
    """Who teaches in one arena, and whom the student meets there.

    Attributes:
        game: the rules.
        teacher: whose worths are learned.
        opponents: each plays an equal part of the games that the attackers leave.
        table: the other side's player by the solved game, by which the attackers look ahead.
    """

    game: Game
    teacher: Teacher
    opponents: tuple[AbstractPolicy, ...]
    table: SaddlePolicy


def open_schools(
    config: RunConfig,
    game: Game,
    folder: Path | None,
    report: Callable[[Role, Sweep], None] = lambda role, sweep: None,
) -> list[School]:
    """The schools of a run, one in each arena, for which the games are solved whose tables do not lie in the folder.

    All have one shape, so that what is compiled for one serves all.

    Args:
        game: that of the run, with charts where players read them.
        report: told after each sweep.

    Raises:
        InvalidInput: when a player cannot be found, the teacher does not value the nine actions, or there are robots of
            several makes.
    """
    scenario, role = game.scenario, config.distillation.side
    if scenario is None:
        grid, hold = reference_grid(game, role)
        return [_open_school(config, game, game, grid.counts, hold, folder, report)]
    makes = "robots of several makes"
    require(scenario.makes is None, "game", makes, "one of one make: whom a table teaches has the table's robots")
    alone = each_alone(game)
    grids = [reference_grid(one, role) for one in alone]
    counts = tuple(np.max([grid.counts for grid, _ in grids], axis=0).tolist())
    return [
        _open_school(config, one, scenario.game(game, jnp.asarray(number)), counts, grids[0][1], folder, report)
        for number, one in enumerate(alone)
    ]


def _open_school(
    config: RunConfig,
    alone: Game,
    game: Game,
    counts: tuple[int, ...],
    hold: int,
    folder: Path | None,
    report: Callable[[Role, Sweep], None],
) -> School:
    """One of them.

    Args:
        alone: the game as its file has it, which is solved.
        game: as it is played.
        counts, hold: of the grid on which the room that is left is known.
    """
    stage, role = config.distillation, config.distillation.side
    tables = kept_tables(alone, stage.grid, folder, report, game)

    def player(name: str, role: Role) -> Named:
        return Named(name, tables[role]) if name == TABLE else find_player(name, role, game)

    found = player(stage.teacher, role)
    values = isinstance(found.policy, AbstractActionValuePolicy)
    require(values, "teacher", stage.teacher, "one that values the nine actions: table, or an agent trained by DQN")
    assert isinstance(found.policy, AbstractActionValuePolicy)
    teacher = Teacher(found.policy, price_of_losing(found, game), _room(game, role, stage.room, counts, hold))
    opponents = tuple(player(name, role.other).policy for name in stage.opponents)
    return School(game, teacher, opponents, tables[role.other])


def _room(game: Game, role: Role, wanted: float, counts: tuple[int, ...], hold: int) -> Room | None:
    if wanted == 0:
        return None
    grid = make_grid(game.arena, game.body(role), counts)
    return Room(motion_of(game, role, _AHEAD), grid, solve_safety(game, role, grid, hold).table, wanted)
