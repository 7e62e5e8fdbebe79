"""The two-robot game solved on a grid: its lower and its upper value.

One side moves first: it holds the action that is best against an opponent who sees it. With f and g
where the two robots are after a hold, and E the mean over the nodes that interpolation draws on,
its value is

    G(s, o) = max over a of  discount * E[ A(f(s, a), o) ],    A(s', o) = min over b of  E[ G(s',
    g(o, b)) ].

The maximum depends on the first robot's node alone and the minimum on the second's, so that a sweep
is two one-sided backups of nine actions each instead of one of 81 pairs. The pursuer's value, when
it moves first, is the lower value of the game; the evader's, its sign turned, is the upper value
(Isaacs, "Differential games", 1965; Bardi and Capuzzo-Dolcetta, 1997, chapter VIII). On every grid
the upper is nowhere less than the lower.

Interpolation in each of many sweeps spreads a robot over cells that it is not in. Where moves along
x and y are taken for whole cells it does not: then the values are exact ones, of robots whose moves
are off by up to half a cell a hold.

Where an action decides the game by a capture (`capture.forcing_actions`), it is worth that.
Otherwise a hold that the first robot does not survive is lost at once, and one that the second does
not survive is won at its end.

Robots do not touch until the game ends, so a table over both is a matrix: the nodes of one by those
of the other. It is kept in tiles, each with all nodes of the robot that moves and a few of the one
that waits, the lanes. A backup then runs along contiguous memory, and what it reads again soon is
still in a core's own cache.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, Shaped

from apollonius.accelerate.fusion_barrier import fusion_barrier
from apollonius.game.types import NUM_ACTIONS, RobotState, Scalar
from apollonius.io.errors import require
from apollonius.io.limits import require_memory
from apollonius.solve.capture import ForcingActions, forcing_actions
from apollonius.solve.grid import FEWER_NODES, Grid, Report, Solved, iterate_values, lanes_of
from apollonius.solve.motion import LOSE, WIN, ZeroSumGame, discount_after
from apollonius.solve.transition_map import Side, make_side

JointTable = Float[Array, "tiles moving lanes"]
"""By the node of the robot that moves and that of the one that waits, which is `tile * lanes +
lane`.
"""
SLACK = 0.05
"""Turns within this many cells of a whole number are taken for it."""
TOLERANCE = 1e-3
"""A sweep that changes no value by more than this is the last one."""
BYTES_PER_PAIR = 3 * 4 + 2
"""Three tables at a time, and what decides."""


class Duel(eqx.Module):
    """The two-robot game on a grid, from the side that moves first; `forcing` is what
    `capture.forcing_actions` returns.
    """

    zero_sum_game: ZeroSumGame
    first: Side
    second: Side
    forcing: ForcingActions


def make_duel(zero_sum_game: ZeroSumGame, whole_cells: bool = False) -> Duel:
    """Prepare the arrays that all sweeps share, for the side that moves first.

    `whole_cells` takes moves along x and y for whole cells, and interpolates only speeds and
    headings. Raises InvalidInput when it does not fit into memory, or the robots' grids do not have
    the same x and y.
    """
    own, other = zero_sum_game.grids
    require(
        own.counts[:2] == other.counts[:2],
        "grid",
        own.name,
        f"as many nodes along x and y as {other.name} has",
    )
    require_memory("grid", own.name, own.size * other.size * BYTES_PER_PAIR, FEWER_NODES)
    sides = zip(zero_sum_game.motions, zero_sum_game.grids, strict=True)
    first, second = (make_side(*side, SLACK, whole_cells) for side in sides)
    return Duel(zero_sum_game, first, second, forcing_actions(zero_sum_game, first, second))


def solve_duel(duel: Duel, report: Report | None = None, tolerance: float = TOLERANCE) -> Solved:
    """Return the value for the first side once it has moved: A(s', o), in tiles in which the second
    robot moves.

    It is within 1 / (1 - discount) times the tolerance, the largest change in the last sweep, of
    the fixed point.
    """
    lanes = lanes_of(duel.first.grid)
    table = jnp.zeros((duel.first.grid.size // lanes, duel.second.grid.size, lanes), jnp.float32)
    return iterate_values(lambda table: _sweep(duel, table), table, report, tolerance)


@eqx.filter_jit
def value_before_move(
    duel: Duel, moved: JointTable
) -> Float[Array, "other_tiles first other_lanes"]:
    """Return the value for the first side before it moves, G(s, o), from that after it, A(s', o).

    The result is in tiles in which the first side moves.
    """
    first = duel.first
    zero_sum_game = duel.zero_sum_game
    lanes = duel.forcing.shape[2]

    def before_move(tile: Int[Array, ""]) -> Float[Array, "moving lanes"]:
        forced = duel.forcing[tile].reshape(-1, *first.grid.shape[2:], lanes)

        def value(
            index: Int[Array, ""], action: int, later: Float[Array, "x y lanes"]
        ) -> Float[Array, "x y lanes"]:
            time = (forced[index] >> NUM_ACTIONS).astype(jnp.float32) * zero_sum_game.game.dt
            value = jnp.where(
                first.free[index, action][..., None], first.motion.discount * later, LOSE
            )
            captured = zero_sum_game.capture * discount_after(time)
            return jnp.where((forced[index] >> action) & 1 > 0, captured, value)

        values = _tile_of(moved, tile, lanes).reshape(*first.grid.shape, lanes)
        return first.transitions.backup(values, value).reshape(-1, lanes)

    return jax.lax.map(before_move, jnp.arange(duel.forcing.shape[0]))


@partial(eqx.filter_jit, donate="all-except-first")
def _sweep(duel: Duel, table: JointTable) -> tuple[JointTable, Scalar]:
    """Return A(s', o) after one more sweep, and the largest change of a value."""
    second = duel.second
    before = value_before_move(duel, table)
    lanes = table.shape[2]

    def value(
        index: Int[Array, ""], action: int, later: Float[Array, "x y lanes"]
    ) -> Float[Array, "x y lanes"]:
        return jnp.where(second.free[index, action][..., None], later, WIN)

    def refresh(
        residual: Scalar, tile: tuple[Int[Array, ""], Float[Array, "moving lanes"]]
    ) -> tuple[Scalar, Float[Array, "moving lanes"]]:
        number, old = tile
        values = _tile_of(before, number, lanes).reshape(*second.grid.shape, lanes)
        new = second.transitions.backup(values, value, jnp.minimum).reshape(-1, lanes)
        return jnp.maximum(residual, jnp.max(jnp.abs(new - old))), new

    residual, after = jax.lax.scan(
        refresh, jnp.zeros((), jnp.float32), (jnp.arange(table.shape[0]), table)
    )
    return after, residual


def _tile_of(
    table: JointTable, tile: Int[Array, ""], lanes: int
) -> Float[Array, "waiting {lanes}"]:
    """Return one tile of the same table after the robots have changed parts."""
    tiles, _, before = table.shape
    block = jax.lax.dynamic_slice(table, (0, tile * lanes, 0), (tiles, lanes, before))
    return jnp.swapaxes(block, 1, 2).reshape(tiles * before, lanes)


def interpolate(
    table: Shaped[Array, "tiles moving lanes"],
    moving: tuple[Grid, RobotState],
    waiting: tuple[Grid, RobotState],
) -> Float[Array, "n games"]:
    """Return values between nodes, multilinear in both states, in several games at once.

    Each robot has its grid and its states, leaves `[games]` of the one that moves, `[n, games]` of
    the one that waits.
    """
    _, width, lanes = table.shape
    entries = table.reshape(-1)
    (nodes, shares), (waiting_nodes, waiting_weights) = _corners(moving, waiting)
    tiles = waiting_nodes // lanes * (width * lanes) + waiting_nodes % lanes

    # One corner of the moving robot after another: of all ways to look up and weigh 256 entries the
    # quickest by far.
    def add(
        total: Float[Array, "n 16 games"], corner: tuple[Array, Array]
    ) -> tuple[Float[Array, "n 16 games"], None]:
        node, share = corner
        around = entries.at[tiles + (node * lanes)[None, None]].get(mode="promise_in_bounds")
        return total + around.astype(jnp.float32) * (waiting_weights * share[None, None]), None

    total, _ = jax.lax.scan(add, jnp.zeros(tiles.shape, jnp.float32), (nodes, shares))
    return jnp.sum(total, axis=1)


@fusion_barrier
def _corners(
    moving: tuple[Grid, RobotState], waiting: tuple[Grid, RobotState]
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return the nodes around the states, `[16, games]` and `[n, 16, games]`, and their shares."""
    around = jax.vmap(moving[0].corners, out_axes=1)(moving[1])
    return around, jax.vmap(jax.vmap(waiting[0].corners, out_axes=1))(waiting[1])
