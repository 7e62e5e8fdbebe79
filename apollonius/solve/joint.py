"""Tables over the states of both robots: how they lie in memory, and the value between their nodes.

Robots do not touch until the game ends, so a table over both is a matrix: the nodes of one by those of the other. It is
kept in tiles, each with all nodes of the robot that moves and a few of the one that waits, the lanes. A backup then
runs along contiguous memory, and what it reads again soon is still in a core's own cache.
"""

from collections.abc import Callable
from functools import partial
from math import log

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, Shaped

from apollonius.game.fusion_barrier import fusion_barrier
from apollonius.game.types import RobotState, Scalar
from apollonius.solve.grid import Grid
from apollonius.solve.side import Side
from apollonius.solve.transition_map import Choice

JointTable = Float[Array, "tiles moving lanes"]
"""By the node of the robot that moves and that of the one that waits, which is `tile * lanes + lane`."""
Worth = Callable[[Int[Array, ""], Int[Array, ""], int, Array], Array]
"""From a tile, a slice, an action and the values after it `[x y lanes]`, what the action is worth."""
_LANES = 64
"""Enough lanes to fill a processor's registers, few enough for its cache."""


def lanes_of(grid: Grid) -> int:
    """How many nodes of a robot that waits share a tile: the divisor of their number that comes closest to `_LANES`."""
    divisors = [count for count in range(1, grid.size + 1) if grid.size % count == 0]
    return min(divisors, key=lambda count: abs(log(count / _LANES)))


def tile_of(
    table: Shaped[Array, "tiles moving before"], tile: Int[Array, ""], lanes: int
) -> Shaped[Array, "waiting lanes"]:
    """One tile of the same table after the robots have changed parts."""
    tiles, _, before = table.shape
    block = jax.lax.dynamic_slice(table, (0, tile * lanes, 0), (tiles, lanes, before))
    return jnp.swapaxes(block, 1, 2).reshape(tiles * before, lanes)


def before_move(
    side: Side, after: JointTable, lanes: int, value: Worth, choose: Choice
) -> Callable[[Int[Array, ""]], Float[Array, "moving lanes"]]:
    """The values before one robot's move, a tile at a time.

    Args:
        side: the robot that moves.
        after: the values after its move, in tiles in which it waits.
        lanes: of the tiles in which it moves.
        choose: from what the nine actions are worth, what the node is worth.
    """

    def tile_before(tile: Int[Array, ""]) -> Float[Array, "moving lanes"]:
        values = tile_of(after, tile, lanes).reshape(*side.grid.shape, lanes)
        return side.transitions.backup(values, partial(value, tile), choose).reshape(-1, lanes)

    return tile_before


def refreshed(
    table: JointTable, tile_before: Callable[[Int[Array, ""]], Float[Array, "moving lanes"]]
) -> tuple[JointTable, Scalar]:
    """The table of new tiles, and the largest change of a value."""

    def refresh(residual: Scalar, tile: tuple[Int[Array, ""], Float[Array, "moving lanes"]]) -> tuple[Scalar, Array]:
        number, old = tile
        new = tile_before(number)
        return jnp.maximum(residual, jnp.max(jnp.abs(new - old))), new

    residual, after = jax.lax.scan(refresh, jnp.zeros((), jnp.float32), (jnp.arange(table.shape[0]), table))
    return after, residual


def interpolate(
    table: Shaped[Array, "tiles moving lanes"],
    moving: tuple[Grid, RobotState],
    waiting: tuple[Grid, RobotState],
) -> Float[Array, "n games"]:
    """Values between nodes, multilinear in both states, in several games at once.

    Args:
        moving: of the robot that moves, its grid and its states, leaves `[games]`.
        waiting: of the one that waits, its grid and several states in each game, leaves `[n, games]`.
    """
    _, width, lanes = table.shape
    entries = table.reshape(-1)
    (nodes, shares), (others, weights) = _corners(moving, waiting)
    tiles = others // lanes * (width * lanes) + others % lanes

    # One corner of the moving robot after another: of all ways to look up and weigh 256 entries the quickest by far.
    def add(total: Float[Array, "n 16 games"], corner: tuple[Array, Array]) -> tuple[Float[Array, "n 16 games"], None]:
        node, share = corner
        around = entries.at[tiles + (node * lanes)[None, None]].get(mode="promise_in_bounds")
        return total + around.astype(jnp.float32) * (weights * share[None, None]), None

    total, _ = jax.lax.scan(add, jnp.zeros(tiles.shape, jnp.float32), (nodes, shares))
    return jnp.sum(total, axis=1)


@fusion_barrier
def _corners(
    moving: tuple[Grid, RobotState], waiting: tuple[Grid, RobotState]
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """The nodes around the states, `[16, games]` and `[n, 16, games]`, and their shares."""
    beside = jax.vmap(moving[0].corners, out_axes=1)(moving[1])
    return beside, jax.vmap(jax.vmap(waiting[0].corners, out_axes=1))(waiting[1])
