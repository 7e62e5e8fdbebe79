"""The teacher of a distillation: what each of the nine actions is worth in a state, as the student shall see it."""

from collections.abc import Callable
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from apollonius.agents.kind import Named
from apollonius.agents.policy import AbstractActionValuePolicy, AbstractPolicy
from apollonius.arenas.suite import each_alone
from apollonius.catalogue import TABLE, find_player, price_of_losing
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, GameState, Real, RobotState, Role, Scalar
from apollonius.io.errors import require
from apollonius.learn.config import RunConfig
from apollonius.observe.observation import perceive
from apollonius.solve.grid import Grid, Sweep, make_grid
from apollonius.solve.motion import Motion, last, motion_of
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.safety import solve_safety
from apollonius.solve.solving import kept_tables, reference_grid

TABLES = "tables"
"""The folder of a run in which the solved game lies."""
_AHEAD = 2
"""Steps of an action after which the room is looked at."""
DEEPEST = 0.3
"""How much worse than the best an action is, at most, before room is looked at: bad is bad, and what a network learns
of how bad is lost to the choice between good ones."""
STEEPNESS = 10.0
"""What a missing metre of room costs."""
COSTLIEST = 0.8
"""What missing room costs at most."""


class Room(eqx.Module):
    """The room that a robot can keep for ever after each of its actions, by the safety table of `solve.safety`.

    Attributes:
        motion: the robot, for as many steps as an action is looked at.
        grid, table: the room [m] at the nodes.
        wanted: with more than this there is nothing to worry about [m].
    """

    motion: Motion
    grid: Grid
    table: Float[Array, "v heading x y"]
    wanted: Real

    def weighed(self, behind: Float[Array, "9"], robot: RobotState) -> Float[Array, "9"]:
        """What the actions are worth once their room counts, from how far each is behind the best.

        As room runs out, what a teacher prefers counts less and less, and room alone in the end: a wall is come to by
        many steps, none of which leaves much less room than another would.
        """
        rooms = jnp.minimum(self.after(robot), self.wanted)
        most = jnp.max(rooms)
        ease = jnp.clip(most / self.wanted, 0.0, 1.0)
        return ease * behind - jnp.minimum(STEEPNESS * (most - rooms), COSTLIEST)

    def after(self, robot: RobotState) -> Float[Array, "9"]:
        """The room after each action [m]."""

        def room(action: Array) -> Scalar:
            course = self.motion.hold(robot, action)
            return jnp.minimum(self.motion.room(course), self.grid.interpolate(self.table, last(course)))

        return jax.vmap(room)(jnp.arange(NUM_ACTIONS))


class Teacher(eqx.Module):
    """A player that values all nine actions, and the room that they leave.

    Attributes:
        policy: the player.
        scale: what a game that is lost is worth to it, about, its sign turned.
        room: of the student's robot; None leaves it out.
    """

    policy: AbstractActionValuePolicy
    scale: Real
    room: Room | None

    def worths(self, game: Game, states: GameState, role: Role) -> Float[Array, "games 9"]:
        """Return what the nine actions are worth in many games, in the player's own units; the best is worth what the
        player says it is.

        Args:
            states: of the games, leaves `[games]`.
            role: the student's side.
        """
        read, rows = perceive(self.policy.observation, game, states, role)
        bits = jnp.zeros((), jnp.uint32)
        values = jax.vmap(lambda row: self.policy.weigh(read(row), self.policy.memory, bits)[0])(rows)
        best = jnp.max(values, axis=1, keepdims=True)
        behind = jnp.maximum((values - best) / self.scale, -DEEPEST)
        if self.room is not None:
            own = states.robots[role][0]
            behind = jax.vmap(self.room.weighed)(behind, own)
        return best + self.scale * (behind - jnp.max(behind, axis=1, keepdims=True))


class Setting(eqx.Module):
    """One arena: the teacher there, and the opponents that the student meets.

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


def make_settings(
    config: RunConfig,
    game: Game,
    folder: Path | None,
    report: Callable[[Role, Sweep], None] = lambda role, sweep: None,
) -> list[Setting]:
    """Return the settings of a run, one in each arena; games are solved whose tables do not lie in the folder.

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
        return [_make_setting(config, game, game, grid.counts, hold, folder, report)]
    makes = "robots of several makes"
    require(scenario.makes is None, "game", makes, "one of one make: whom a table teaches has the table's robots")
    alone = each_alone(game)
    grids = [reference_grid(one, role) for one in alone]
    counts = tuple(np.max([grid.counts for grid, _ in grids], axis=0).tolist())
    return [
        _make_setting(config, one, scenario.game(game, jnp.asarray(number)), counts, grids[0][1], folder, report)
        for number, one in enumerate(alone)
    ]


def _make_setting(
    config: RunConfig,
    alone: Game,
    game: Game,
    counts: tuple[int, ...],
    hold: int,
    folder: Path | None,
    report: Callable[[Role, Sweep], None],
) -> Setting:
    """Return one of them.

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
    room = None
    if stage.room > 0:
        grid = make_grid(game.arena, game.body(role), counts)
        room = Room(motion_of(game, role, _AHEAD), grid, solve_safety(game, role, grid, hold).table, stage.room)
    teacher = Teacher(found.policy, price_of_losing(found, game), room)
    opponents = tuple(player(name, role.other).policy for name in stage.opponents)
    return Setting(game, teacher, opponents, tables[role.other])
