"""Starts that are lost before they begin: a robot in them cannot help crashing."""

import functools
from collections.abc import Callable
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.tree_util import Partial
from jaxtyping import Array, Bool, PRNGKeyArray

from apollonius.game.by_side import BySide
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import ROLES, GameState, RobotState, Role, Scalar
from apollonius.io.cache import Memory
from apollonius.io.errors import InvalidInput
from apollonius.solve.grid import Table
from apollonius.solve.motion import motion_of
from apollonius.solve.safety import solve_safety, steered_brakes
from apollonius.solve.solving import reference_grid

_tables = Memory[Table](4)
_ROUNDS = 1000
"""Draws of as many starts as are wanted, before a game is refused of which hardly any is viable."""


class Viability(BySide[Callable[[RobotState], Scalar]]):
    """The judge of starts from which both robots can stay clear of everything for ever, by the clearance [m] that each
    can keep."""

    def __call__(self, state: GameState) -> Bool[Array, ""]:
        """Return whether every robot can stay clear."""
        sides = zip(self, state.robots, strict=True)
        kept = [judge(robot) >= 0 for judge, robots in sides for robot in robots]
        return functools.reduce(jnp.logical_and, kept)


def solve_viability(game: Game) -> Viability:
    """Solve both robots' safety on a grid; the latest tables are remembered.

    A robot that brakes to rest is lost where neither braking straight or in a turn, nor braking as the kernel steers,
    comes to rest without contact in the continuous game. Another one is lost where its table says so. Raises
    InvalidInput for several arenas, a team of unlike robots, and a grid that memory has no room for.
    """
    game.require_one_arena("what says which starts are lost")
    game = game.duel("what says which starts are lost")
    game = replace(game, arena=replace(game.arena, chart=None))
    return Viability(*ROLES.map(lambda role: _judge(game, role)))


def _judge(game: Game, role: Role) -> Callable[[RobotState], Scalar]:
    body = game.body(role)
    grid, hold = reference_grid(game, role, coarse=body.brakes_to_rest)
    # All that a table depends on: not rewards or the time limit.
    table = _tables.get((motion_of(game, role, hold), grid), lambda: solve_safety(game, role, grid, hold).table)
    return (
        steered_brakes(game, role, grid, table).clearance if body.brakes_to_rest else Partial(grid.interpolate, table)
    )


@eqx.filter_jit
def _draw(game: Game, viability: Viability, key: PRNGKeyArray, games: int) -> tuple[GameState, Bool[Array, " games"]]:
    starts = reset_batch(game, key, games)
    return starts, jax.vmap(viability)(starts)


def doomed_start_rate(game: Game, viability: Viability, starts: int = 20_000) -> float:
    """Return the share of a game's starts that are lost before they begin, of `starts` with a fixed seed."""
    return 1 - float(jnp.mean(_draw(game, viability, jax.random.key(0), starts)[1]))


def viable_starts(game: Game, viability: Viability, key: PRNGKeyArray, games: int) -> GameState:
    """Draw initial states of several games, none lost, leaves `[games]`. The key is consumed.

    Raises InvalidInput when hardly any start of the game is viable.
    """
    kept: list[GameState] = []
    missing = games
    for round_key in jax.random.split(key, _ROUNDS):
        starts, viable = _draw(game, viability, round_key, games)
        chosen = np.flatnonzero(viable)
        kept.append(jax.tree.map(lambda leaf, chosen=chosen: np.asarray(leaf)[chosen], starts))
        missing -= len(chosen)
        if missing <= 0:
            return jax.tree.map(lambda *leaves: jnp.asarray(np.concatenate(leaves)[:games]), *kept)
    raise InvalidInput(
        f"of {_ROUNDS * games:,} starts only {games - missing:,} are viable, too few for {games:,} games: "
        "make the robots slower or the arena larger."
    )
