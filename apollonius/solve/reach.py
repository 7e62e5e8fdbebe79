"""The least time in which the pursuer catches a target that stands still, without touching
anything.

The value of a state is U = exp(-T / HORIZON), with T the time to capture: 1 at the capture, 0 where
none can be. This is Kruzhkov's transform (Bardi and Capuzzo-Dolcetta, "Optimal control and
viscosity solutions of Hamilton-Jacobi-Bellman equations", 1997, chapter IV); U is also the value of
a capture under that discount. The value of a held action is

    exp(-t / HORIZON)            if it captures after t seconds,
    0                            if the robot fails before that,
    exp(-seconds / HORIZON) U    of the state after it, otherwise,

and U is the greatest. Begun at 0, the iteration only goes up.
"""

from math import ceil

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from apollonius.agents.policy import AbstractActionValuePolicy
from apollonius.game.game import Game
from apollonius.game.types import Outcome, RobotState, Role, Scalar
from apollonius.io.errors import require
from apollonius.io.limits import require_memory
from apollonius.observe.view import View
from apollonius.solve.grid import FEWER_NODES, Grid, Report, Solved, iterate_values
from apollonius.solve.motion import (
    HORIZON,
    Motion,
    discount_after,
    end_state,
    every_hold,
    first_events,
    motion_of,
)
from apollonius.solve.transition_map import Side, make_side

BYTES_PER_NODE = 4 * (9 + 6) + 9
"""The clearances of nine actions and whether they suffice, the table before and after a sweep,
padded, and captures.
"""


class Reach(AbstractActionValuePolicy):
    """The least time to a target [m], by U at the nodes of the pursuer's grid, and the pursuer that
    takes it.
    """

    game: Game
    motion: Motion
    grid: Grid
    target_x: Scalar
    target_y: Scalar
    table: Float[Array, "v heading x y"]

    def values(self, view: View) -> Float[Array, "9"]:
        return self.action_values(view.own.state)

    def action_values(self, robot: RobotState) -> Float[Array, "9"]:
        """Return the value of each action, held by the rules and then interpolated."""
        target = self.target_x, self.target_y
        over, value, after = _hold_values(self.game, self.motion, robot, *target)
        later = jax.vmap(lambda robot: self.grid.interpolate(self.table, robot))(after)
        return jnp.where(over, value, self.motion.discount * later)

    def seconds(self, robot: RobotState) -> Scalar:
        """Return the time to capture [s]; infinite without a capture."""
        return -HORIZON * jnp.log(jnp.max(self.action_values(robot)))


def solve_reach(
    game: Game, grid: Grid, hold: int, target: tuple[float, float], report: Report | None = None
) -> tuple[Reach, Solved]:
    """Compute the least time to a target from everywhere on the pursuer's grid.

    Args:
        game: the rules.
        grid: the grid of the pursuer's states.
        hold: control steps for which an action is held.
        target: position x, y of the evader, which stands still [m].
        report: gets the progress after each sweep.

    Raises:
        InvalidInput: if the target could not stand there, or the tables do not fit into memory.
    """
    require_memory("grid", grid.name, grid.size * BYTES_PER_NODE, FEWER_NODES)
    x, y = (jnp.asarray(coordinate, jnp.float32) for coordinate in target)
    is_clear = float(game.arena.clearance(x, y)) >= game.evader.radius
    require(is_clear, "target", target, f"{game.evader.radius} m clear of walls and discs at least")
    side = make_side(motion_of(game, Role.PURSUER, hold), grid)
    farthest = game.capture_distance + side.motion.farthest
    cells = ceil(farthest / grid.spacing[0]) + 1, ceil(farthest / grid.spacing[1]) + 1
    captures = _caught(game, side, cells, x, y)
    solution = iterate_values(
        lambda table: _sweep(side, captures, table), jnp.zeros(grid.shape, jnp.float32), report
    )
    return Reach(game, side.motion, grid, x, y, solution.table), solution


@eqx.filter_jit
def _sweep(
    side: Side, caught: Float[Array, "v heading x y"], table: Float[Array, "v heading x y"]
) -> tuple[Float[Array, "v heading x y"], Scalar]:
    def value(
        index: Int[Array, ""], action: int, later: Float[Array, "x y"]
    ) -> Float[Array, "x y"]:
        return jnp.where(side.free[index, action], side.motion.discount * later, 0.0)

    after = jnp.maximum(caught, side.transitions.backup(table, value))
    return after, jnp.max(jnp.abs(after - table))


def _hold_values(
    game: Game, motion: Motion, robot: RobotState, x: Scalar, y: Scalar
) -> tuple[Bool[Array, "9"], Float[Array, "9"], RobotState]:
    """Hold each action: whether the game ends meanwhile, the value of that, and the robot after."""
    courses = every_hold(motion, jax.tree.map(lambda leaf: leaf[None], robot))
    target = RobotState(x, y, jnp.zeros_like(x), jnp.zeros_like(y))
    still = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (motion.steps + 1, 1, 1)), target)
    outcome, seconds = first_events(game, courses, still)
    value = jnp.where(outcome == Outcome.CAPTURED, discount_after(seconds), 0.0)
    after = jax.tree.map(lambda leaf: leaf[:, 0], end_state(courses))
    return (outcome != Outcome.ONGOING)[:, 0, 0], value[:, 0, 0], after


@eqx.filter_jit
def _caught(
    game: Game, side: Side, cells: tuple[int, int], x: Scalar, y: Scalar
) -> Float[Array, "v heading x y"]:
    """Return the value of the best capture within one hold at each node; it is 0 farther away than
    `cells`.
    """
    grid = side.grid
    near = []
    for axis, target in enumerate((x, y)):
        low = grid.low[axis]
        distance = grid.spacing[axis]
        count = grid.counts[axis]
        reach = cells[axis]
        width = min(2 * reach + 1, count)
        nearest = jnp.round((target - low) / distance).astype(jnp.int32)
        near.append(jnp.clip(nearest - reach, 0, count - width) + jnp.arange(width))

    def best(index: Int[Array, ""]) -> Float[Array, "x y"]:
        def at(row: Int[Array, ""], column: Int[Array, ""]) -> Scalar:
            node = grid.node(index // grid.shape[1], index % grid.shape[1], row, column)
            return jnp.max(_hold_values(game, side.motion, node, x, y)[1])

        return jax.vmap(lambda row: jax.vmap(lambda column: at(row, column))(near[1]))(near[0])

    values = jax.lax.map(best, jnp.arange(grid.shape[0] * grid.shape[1]))
    captures = jnp.zeros((values.shape[0], *grid.shape[2:]), jnp.float32)
    captures = jax.lax.dynamic_update_slice(
        captures, values, (jnp.zeros((), jnp.int32), near[0][0], near[1][0])
    )
    return captures.reshape(grid.shape)
