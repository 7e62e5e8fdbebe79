"""The least time in which the pursuer catches a target that stands still, without touching anything.

The value of a state is U = exp(-T / HORIZON), with T the time to capture: 1 at the capture, 0 where none can be. This
is Kruzhkov's transform (Bardi and Capuzzo-Dolcetta, "Optimal control and viscosity solutions of
Hamilton-Jacobi-Bellman equations", 1997, chapter IV); U is also what a capture is worth under that discount. A held
action is worth

    exp(-t / HORIZON)            if it captures after t seconds,
    0                            if the robot fails before that,
    exp(-seconds / HORIZON) U    of the state after it, otherwise,

and U is the best worth of an action. Begun at 0, the iteration only goes up.
"""

from collections.abc import Callable
from math import ceil

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from apollonius.agents.policy import AbstractActionValuePolicy
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, Outcome, RobotState, Role, Scalar
from apollonius.io.errors import require
from apollonius.io.limits import require_memory
from apollonius.observe.view import View
from apollonius.solve.grid import FEWER_NODES, Grid, Solved, Sweep, iterate, silent
from apollonius.solve.motion import HORIZON, Motion, discount_after, last
from apollonius.solve.transition_map import Side, make_side
from apollonius.solve.zero_sum_game import first_event

BYTES_PER_NODE = 4 * (9 + 6) + 9
"""The rooms of nine actions and whether they suffice, the table before and after a sweep, padded, and captures."""


class Chase(eqx.Module):
    """The pursuer alone on a grid, before anyone says where the target is.

    Attributes:
        game: the rules.
        side: the pursuer on its grid.
        reach: how far from a target a hold can capture it, in nodes along x and y.
    """

    game: Game
    side: Side
    reach: tuple[int, int] = eqx.field(static=True)


class Reach(AbstractActionValuePolicy):
    """The least time to one target, and the pursuer that takes it: it decides again in every step.

    Attributes:
        game: the rules.
        motion, grid: the pursuer's.
        target_x, target_y: where the target stands [m].
        table: U at the nodes.
    """

    game: Game
    motion: Motion
    grid: Grid
    target_x: Scalar
    target_y: Scalar
    table: Float[Array, "v heading x y"]

    def values(self, seen: View) -> Float[Array, "9"]:
        return self.action_values(seen.own.state)

    def action_values(self, robot: RobotState) -> Float[Array, "9"]:
        """What each action is worth where the robot is, held by the rules and then interpolated."""

        def value(action: Int[Array, ""]) -> Scalar:
            course = self.motion.hold(robot, action)
            over, value = _event(self.game, course, self.target_x, self.target_y)
            later = self.motion.discount * self.grid.interpolate(self.table, last(course))
            return jnp.where(over, value, later)

        return jax.vmap(value)(jnp.arange(NUM_ACTIONS))

    def seconds(self, robot: RobotState) -> Scalar:
        """The time to capture [s]; infinite where there is none."""
        return -HORIZON * jnp.log(jnp.max(self.action_values(robot)))


def make_chase(game: Game, grid: Grid, hold: int) -> Chase:
    """What all targets on a grid have in common.

    Args:
        hold: control steps for which an action is held.

    Raises:
        InvalidInput: when it does not fit into memory.
    """
    require_memory("grid", grid.name, grid.size * BYTES_PER_NODE, FEWER_NODES)
    side = make_side(game, Role.PURSUER, grid, hold)
    farthest = game.capture_distance + side.farthest
    reach = ceil(farthest / grid.spacing[0]) + 1, ceil(farthest / grid.spacing[1]) + 1
    return Chase(game, side, reach)


def solve_reach(
    chase: Chase, target: tuple[float, float], report: Callable[[Sweep], None] = silent
) -> tuple[Reach, Solved]:
    """The least time to a target, from everywhere.

    Args:
        target: its x and y [m].
        report: told after each sweep.

    Raises:
        InvalidInput: for a target that could not stand there.
    """
    game = chase.game
    x, y = (jnp.asarray(coordinate, jnp.float32) for coordinate in target)
    room = float(game.arena.clearance(x, y))
    require(room >= game.evader.radius, "target", target, f"{game.evader.radius} m clear of walls and discs at least")
    caught = _caught(chase, x, y)
    nothing = jnp.zeros(chase.side.grid.shape, jnp.float32)
    solved = iterate(lambda table: _sweep(chase, caught, table), nothing, report)
    return Reach(game, chase.side.motion, chase.side.grid, x, y, solved.table), solved


@eqx.filter_jit
def _sweep(
    chase: Chase, caught: Float[Array, "v heading x y"], table: Float[Array, "v heading x y"]
) -> tuple[Float[Array, "v heading x y"], Scalar]:
    def value(index: Int[Array, ""], action: int, later: Float[Array, "x y"]) -> Float[Array, "x y"]:
        return jnp.where(chase.side.free[index, action], chase.side.motion.discount * later, 0.0)

    after = jnp.maximum(caught, chase.side.transitions.backup(table, value))
    return after, jnp.max(jnp.abs(after - table))


def _event(game: Game, course: RobotState, x: Scalar, y: Scalar) -> tuple[Bool[Array, ""], Scalar]:
    """Whether the rules end the game along a course, and what that is worth."""
    still = jnp.zeros_like(course.v)
    target = jax.tree.map(lambda place: place + still, RobotState(x, y, jnp.zeros_like(x), jnp.zeros_like(x)))
    over, outcome, seconds = first_event(game, course, target)
    return over, jnp.where(outcome == Outcome.CAPTURED, discount_after(seconds), 0.0)


@eqx.filter_jit
def _caught(chase: Chase, x: Scalar, y: Scalar) -> Float[Array, "v heading x y"]:
    """What the best capture within one hold is worth at each node; only those near the target are looked at."""
    grid = chase.side.grid
    beside = []
    for axis, target in enumerate((x, y)):
        low, distance, count, reach = grid.low[axis], grid.spacing[axis], grid.counts[axis], chase.reach[axis]
        width = min(2 * reach + 1, count)
        nearest = jnp.round((target - low) / distance).astype(jnp.int32)
        beside.append(jnp.clip(nearest - reach, 0, count - width) + jnp.arange(width))

    def best(index: Int[Array, ""]) -> Float[Array, "x y"]:
        def at(row: Int[Array, ""], column: Int[Array, ""]) -> Scalar:
            node = grid.node(index // grid.shape[1], index % grid.shape[1], row, column)
            events = jax.vmap(lambda action: _event(chase.game, chase.side.motion.hold(node, action), x, y)[1])
            return jnp.max(events(jnp.arange(NUM_ACTIONS)))

        return jax.vmap(lambda row: jax.vmap(lambda column: at(row, column))(beside[1]))(beside[0])

    near = jax.lax.map(best, jnp.arange(grid.shape[0] * grid.shape[1]))
    caught = jnp.zeros((near.shape[0], *grid.shape[2:]), jnp.float32)
    caught = jax.lax.dynamic_update_slice(caught, near, (jnp.zeros((), jnp.int32), beside[0][0], beside[1][0]))
    return caught.reshape(grid.shape)
