"""The image of a grid's nodes under each action, held.

Motion does not depend on x and y (Eq. 1), so a held action moves all nodes of one speed and heading
by the same vector. The values after it are therefore one or a few (x, y) slices of the table,
shifted by whole cells and interpolated over the rest: no gather.
"""

from collections.abc import Callable
from functools import reduce
from itertools import product

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from apollonius.game.types import NUM_ACTIONS, Real, RobotState, Scalar
from apollonius.io.limits import require_memory
from apollonius.solve.grid import Grid
from apollonius.solve.motion import NEVER, Motion

_ROUNDING = 2e-5
"""A move within this many cells of a whole number is whole: single precision tells no more."""

_BYTES_PER_STATE = 40
"""Memory of a state along a hold, and of what it is computed from."""
_BYTES_PER_CLEARANCE = 40
"""Memory of the clearance of a step from a node, and of what it is computed from."""


class TransitionMap(eqx.Module):
    """The images of a grid's slices under held actions; slices are numbered `v * headings +
    heading`.

    Attributes:
        course: the states along each hold that begins at the origin, leaves `[slices 9 steps+1]`.
        source, weight: the slices between whose speeds and headings it ends, and their shares.
        cells, fraction: the move along x and y, in whole cells and the fraction of one that is
            left; None where moves are whole.
        margin: cells by which a hold can leave the grid.
    """

    course: RobotState
    source: Int[Array, "slices 9 terms"]
    weight: Float[Array, "slices 9 terms"]
    cells: Int[Array, "slices 9 2"]
    fraction: Float[Array, "slices 9 2"] | None
    margin: int = eqx.field(static=True)

    def backup(
        self,
        table: Float[Array, "v heading x y *others"],
        value: Callable[
            [Int[Array, ""], int, Float[Array, "x y *others"]], Float[Array, "x y *others"]
        ],
        choose: Callable[[Array, Array], Array] = jnp.maximum,
    ) -> Float[Array, "v heading x y *others"]:
        """Return the value of each node: the best, by `choose`, of the values of its nine actions.

        Args:
            table: values after the hold. Those for each state of `others` are adjacent in memory.
            value: an action's value, from the slice, the action and the table's values after it.
            choose: the better of two arrays, element by element.
        """
        slices = table.reshape(-1, *table.shape[2:])
        on_places = (self.margin, self.margin)
        margins = ((0, 0), on_places, on_places, *((0, 0),) * (table.ndim - 4))
        wide_slices = jnp.pad(slices, margins, mode="edge")

        def best_value(index: Int[Array, ""]) -> Float[Array, "x y *others"]:
            values: list[Array] = []
            for action in range(NUM_ACTIONS):
                later = self._after(wide_slices, index, action)
                values.append(value(index, action, later))
            return reduce(choose, values)

        return jax.lax.map(best_value, jnp.arange(slices.shape[0])).reshape(table.shape)

    def _after(
        self,
        wide_slices: Float[Array, "slices wide high *others"],
        index: Int[Array, ""],
        action: int,
    ) -> Array:
        """Interpolate the values after an action from each node of a slice: `[x y *others]`."""
        across, along = (count - 2 * self.margin for count in wide_slices.shape[1:3])
        values = jnp.zeros((), jnp.float32)
        for term in range(self.source.shape[2]):
            for offset, share in self._corners(index, action):
                corner = self.cells[index, action] + jnp.array(offset) + self.margin
                start = (self.source[index, action, term], *corner, *(0,) * (wide_slices.ndim - 3))
                values_there = jax.lax.dynamic_slice(
                    wide_slices, start, (1, across, along, *wide_slices.shape[3:])
                )[0]
                values = values + self.weight[index, action, term] * share * values_there
        return values

    def _corners(self, index: Int[Array, ""], action: int) -> list[tuple[tuple[int, int], Real]]:
        """Return the corners of the cell in which an action ends, as offsets along x and y from the
        lower left one, with their bilinear weights.
        """
        if self.fraction is None:
            return [((0, 0), 1.0)]
        on_x, on_y = ((1 - share, share) for share in self.fraction[index, action])
        return [((x, y), on_x[x] * on_y[y]) for x, y in product((0, 1), repeat=2)]


def transition_map_of(
    motion: Motion, grid: Grid, slack: float = 0.0, whole_cells: bool = False
) -> TransitionMap:
    """Return the images of the grid's nodes under the robot's held actions.

    Args:
        motion: the robot's motion while actions are held.
        grid: the grid of its states.
        slack: turns within this many cells of a whole number are taken as whole: where they are a
            hundredth of a cell off, interpolation would blur headings more.
        whole_cells: whether moves along x and y are rounded, too.

    Raises:
        InvalidInput: if the courses of the actions do not fit into memory.
    """
    fewer = "hold actions for fewer steps, or take fewer nodes"
    require_memory("hold", motion.steps, _bytes_of_hold(motion, grid), fewer)
    speeds, headings = grid.shape[:2]
    course = _courses(motion, grid)
    end = jax.tree.map(lambda leaf: np.asarray(leaf[..., -1], np.float64), course)
    dx, dy, dv, dheading = (float(distance) for distance in grid.spacing)
    cells, fraction = _cells_and_fraction(
        np.stack([end.x / dx, end.y / dy], axis=-1), 1.0 if whole_cells else 0.0
    )
    slower, share_v = _cells_and_fraction((end.v - float(grid.low[2])) / dv)
    before, share_heading = _cells_and_fraction(end.heading / dheading, slack)
    terms = [
        (
            np.minimum(slower + up, speeds - 1) * headings + (before + on) % headings,
            part_v * part_heading,
        )
        for up, part_v in ((0, 1 - share_v), (1, share_v))
        for on, part_heading in ((0, 1 - share_heading), (1, share_heading))
    ]
    used_terms = [(source, weight) for source, weight in terms if np.any(weight > 0)]
    return TransitionMap(
        course=course,
        source=jnp.asarray(np.stack([source for source, _ in used_terms], axis=-1), jnp.int32),
        weight=jnp.asarray(np.stack([weight for _, weight in used_terms], axis=-1), jnp.float32),
        cells=jnp.asarray(cells, jnp.int32),
        fraction=None if whole_cells else jnp.asarray(fraction, jnp.float32),
        margin=int(np.max(np.abs(cells))) + 1,
    )


def _bytes_of_hold(motion: Motion, grid: Grid) -> int:
    """Return the memory of all actions' courses: the states, their clearances everywhere, and the
    grid's margins.
    """
    speeds, headings, *places = grid.shape
    wide, high = (
        count + 2 * (motion.farthest / float(spacing) + 2)
        for count, spacing in zip(places, grid.spacing[:2], strict=True)
    )
    courses_bytes = speeds * headings * NUM_ACTIONS * (motion.steps + 1) * _BYTES_PER_STATE
    clearances_bytes = places[0] * places[1] * motion.steps * _BYTES_PER_CLEARANCE
    return int(courses_bytes + clearances_bytes + speeds * headings * wide * high * 4)


@eqx.filter_jit
def _courses(motion: Motion, grid: Grid) -> RobotState:
    """Return the states along every hold from the origin."""
    first = jnp.zeros((), jnp.int32)
    origin = jnp.zeros((), jnp.float32)

    def course(index: Int[Array, ""], action: Int[Array, ""]) -> RobotState:
        start = grid.node(index // grid.shape[1], index % grid.shape[1], first, first)
        return motion.hold(RobotState(origin, origin, start.v, start.heading), action)

    actions, slices = jnp.arange(NUM_ACTIONS), jnp.arange(grid.shape[0] * grid.shape[1])
    return jax.vmap(lambda index: jax.vmap(lambda action: course(index, action))(actions))(slices)


def _cells_and_fraction(cells: np.ndarray, slack: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    nearest = np.round(cells)
    cells = np.where(np.abs(cells - nearest) < max(slack, _ROUNDING), nearest, cells)
    return np.floor(cells).astype(np.int64), cells - np.floor(cells)


@eqx.filter_jit
def over_courses(
    function: Callable[[RobotState], Array], grid: Grid, transitions: TransitionMap
) -> Array:
    """Apply a function of a course to each action's course from each node: `[slices 9 x y]`."""
    x, y = grid.node_positions()

    def at_all_nodes(course: RobotState) -> Array:
        def at_node(x: Scalar, y: Scalar) -> Array:
            def move(robot: RobotState) -> RobotState:
                return RobotState(robot.x + x, robot.y + y, robot.v, robot.heading)

            return function(jax.vmap(move)(course))

        return jax.vmap(lambda row: jax.vmap(lambda column: at_node(row, column))(y))(x)

    return jax.lax.map(lambda courses: jax.lax.map(at_all_nodes, courses), transitions.course)


class Side(eqx.Module):
    """One robot on its grid: where its held actions lead, and the step in which they touch
    something, or `NEVER`.
    """

    motion: Motion
    grid: Grid
    transitions: TransitionMap
    failure: UInt8[Array, "slices 9 x y"]

    @property
    def free(self) -> Bool[Array, "slices 9 x y"]:
        """Holds that the robot survives as a whole."""
        return self.failure == NEVER


def make_side(motion: Motion, grid: Grid, slack: float = 0.0, whole_cells: bool = False) -> Side:
    """Return one robot on its grid.

    Args:
        motion, grid, slack, whole_cells: as in `transition_map_of`.
    """
    transitions = transition_map_of(motion, grid, slack, whole_cells)
    return Side(motion, grid, transitions, over_courses(motion.failure, grid, transitions))
