"""Who teaches in a distillation, and whom the student meets."""

from collections.abc import Callable
from pathlib import Path

import equinox as eqx

from apollonius.agents.kind import Named
from apollonius.agents.policy import AbstractActionValuePolicy, AbstractPolicy
from apollonius.catalogue import TABLE, find_player, price_of_losing
from apollonius.errors import require
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.learn.config import RunConfig
from apollonius.learn.teacher import Room, Teacher
from apollonius.solve.iteration import Sweep
from apollonius.solve.kept import kept_tables
from apollonius.solve.motion import motion_of
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.reference import reference_grid
from apollonius.solve.safety import solve_safety

TABLES = "tables"
"""The folder of a run in which the solved game lies."""
_AHEAD = 2
"""Steps of an action after which the room is looked at."""


class School(eqx.Module):
    """Who teaches, and whom the student meets.

    Attributes:
        teacher: whose worths are learned.
        opponents: each plays an equal part of the games that the attackers leave.
        table: the other side's player by the solved game, by which the attackers look ahead.
    """

    teacher: Teacher
    opponents: tuple[AbstractPolicy, ...]
    table: SaddlePolicy


def open_school(
    config: RunConfig, folder: Path | None, report: Callable[[Role, Sweep], None] = lambda role, sweep: None
) -> School:
    """The school of a run, for which the game is solved if its tables do not lie in the folder.

    Args:
        report: told after each sweep.

    Raises:
        InvalidInput: when a player cannot be found, or the teacher does not value the nine actions.
    """
    game, stage = config.game, config.distillation
    role = stage.side
    tables = kept_tables(game, stage.grid, folder, report)

    def player(name: str, role: Role) -> Named:
        return Named(name, tables[role]) if name == TABLE else find_player(name, role, game)

    found = player(stage.teacher, role)
    values = isinstance(found.policy, AbstractActionValuePolicy)
    require(values, "teacher", stage.teacher, "one that values the nine actions: table, or an agent trained by DQN")
    assert isinstance(found.policy, AbstractActionValuePolicy)
    teacher = Teacher(found.policy, price_of_losing(found, game), _room(game, role, stage.room))
    opponents = tuple(player(name, role.other).policy for name in stage.opponents)
    return School(teacher, opponents, tables[role.other])


def _room(game: Game, role: Role, wanted: float) -> Room | None:
    if wanted == 0:
        return None
    grid, hold = reference_grid(game, role)
    return Room(motion_of(game, role, _AHEAD), grid, solve_safety(game, role, grid, hold).table, wanted)
