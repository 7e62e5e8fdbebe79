"""A grid over the states of one robot, and the value between its nodes."""

from collections.abc import Callable
from dataclasses import dataclass
from math import log, prod

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.obstacle import between_nodes
from apollonius.game.types import Real, RobotState, Scalar
from apollonius.io.errors import require

AXES = ("x", "y", "v", "heading")
"""In the order in which a grid is written: `101x101x9x47`."""
_LANES = 64
"""Enough lanes to fill a processor's registers, few enough for its cache."""
FEWER_NODES = "take fewer nodes"
"""Remedy for a grid that does not fit into memory."""


class Grid(eqx.Module):
    """Nodes from wall to wall, from the lowest speed to the highest, and around the circle of
    headings.

    A table on the grid has the shape (v, heading, x, y): a held action moves a whole slice over (x,
    y) at once.

    Attributes:
        low, high: least and greatest x [m], y [m] and v [m/s]; nodes lie on both.
        counts: number of nodes along x, y, v and heading.
    """

    low: tuple[Real, Real, Real]
    high: tuple[Real, Real, Real]
    counts: tuple[int, int, int, int] = eqx.field(static=True)

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Shape of a table: (v, heading, x, y)."""
        x, y, v, heading = self.counts
        return v, heading, x, y

    @property
    def size(self) -> int:
        return prod(self.counts)

    @property
    def name(self) -> str:
        """The counts as the command line writes them: `101x101x9x47`."""
        return "x".join(map(str, self.counts))

    @property
    def spacing(self) -> tuple[Real, Real, Real, Real]:
        ends = zip(self.low, self.high, self.counts[:3], strict=True)
        x, y, v = ((high - low) / (count - 1) for low, high, count in ends)
        return x, y, v, 2 * jnp.pi / self.counts[3]

    def node(
        self, v: Int[Array, ""], heading: Int[Array, ""], x: Int[Array, ""], y: Int[Array, ""]
    ) -> RobotState:
        """Return the state at a node; its heading is in [0, 2 pi).

        Args:
            v, heading, x, y: indices of the node along each axis.
        """
        dx, dy, dv, dheading = self.spacing
        return RobotState(
            x=self.low[0] + x.astype(jnp.float32) * dx,
            y=self.low[1] + y.astype(jnp.float32) * dy,
            v=self.low[2] + v.astype(jnp.float32) * dv,
            heading=heading.astype(jnp.float32) * dheading,
        )

    def corners(self, robot: RobotState) -> tuple[Int[Array, "16"], Float[Array, "16"]]:
        """Return the nodes around a state, numbered as they lie in a table, and their shares; at an
        end, its own.
        """
        dx, dy, dv, dheading = self.spacing
        axes = (
            _between((robot.v - self.low[2]) / dv, self.counts[2]),
            _around(robot.heading / dheading, self.counts[3]),
            _between((robot.x - self.low[0]) / dx, self.counts[0]),
            _between((robot.y - self.low[1]) / dy, self.counts[1]),
        )
        node, share = jnp.zeros(1, jnp.int32), jnp.ones(1, jnp.float32)
        for (nodes, shares), count in zip(axes, self.shape, strict=True):
            node = (node[:, None] * count + jnp.stack(nodes)[None]).reshape(-1)
            share = (share[:, None] * jnp.stack(shares)[None]).reshape(-1)
        return node, share

    def interpolate(self, table: Float[Array, "v heading x y"], robot: RobotState) -> Scalar:
        """Return the table's value at a state, multilinear between the 16 nodes around it."""
        nodes, shares = self.corners(robot)
        return jnp.sum(shares * table.reshape(-1)[nodes])

    def node_positions(self) -> tuple[Float[Array, " x"], Float[Array, " y"]]:
        """Return the nodes' x and y [m]."""
        axes = zip(self.low[:2], self.counts[:2], self.spacing[:2], strict=True)
        x, y = (low + jnp.arange(count, dtype=jnp.float32) * step for low, count, step in axes)
        return x, y


Neighbours = tuple[tuple[Int[Array, ""], Int[Array, ""]], tuple[Scalar, Scalar]]
"""Along one axis, the two nodes beside a state, and their weights."""


def _between(position: Scalar, count: int) -> Neighbours:
    index, share = between_nodes(position, count)
    return (index, index + 1), (1 - share, share)


def _around(position: Scalar, count: int) -> Neighbours:
    lower = jnp.floor(position)
    index = lower.astype(jnp.int32)
    return (index % count, (index + 1) % count), (1 - (position - lower), position - lower)


def make_grid(arena: Arena, body: Unicycle, counts: tuple[int, ...]) -> Grid:
    """Return the grid of one robot in an arena; raises InvalidInput for fewer than 2 nodes along an
    axis, or 3 headings."""
    text = "x".join(map(str, counts))
    require(
        len(counts) == len(AXES),
        "grid",
        text,
        f"four whole numbers for {', '.join(AXES)}, as 101x101x9x47",
    )
    require(
        min(counts[:3]) >= 2 and counts[3] >= 3,
        "grid",
        text,
        "2x2x2x3 at least, as values lie between nodes",
    )
    require(
        body.v_min < body.v_max,
        "v_min",
        body.v_min,
        f"less than v_max = {body.v_max} m/s, to have speeds between",
    )
    x, y, v, heading = counts
    low = (float(arena.x_min), float(arena.y_min), float(body.v_min))
    high = (float(arena.x_max), float(arena.y_max), float(body.v_max))
    return Grid(low, high, (x, y, v, heading))


Table = Float[Array, "..."]
"""Values at the nodes of a grid."""
TOLERANCE = 1e-4
"""A sweep that changes no value by more than this is the last one, where nothing else is asked."""
_MOST_SWEEPS = 10_000
_ROUNDING = 1e-7
"""Changes of this size count as none in the share of a solution that is done."""


@dataclass(frozen=True)
class Sweep:
    """Progress after a sweep."""

    number: int
    residual: float
    """Largest change of a value."""
    share: float
    """The share of a solution that is done."""


Report = Callable[[Sweep], None]
"""Called after each sweep."""


@dataclass(frozen=True)
class Solved:
    """A table that a sweep leaves as it is, but for the residual."""

    table: Table
    sweeps: int
    residual: float


def iterate_values(
    sweep: Callable[[Table], tuple[Table, Scalar]],
    table: Table,
    report: Report | None = None,
    tolerance: float = TOLERANCE,
) -> Solved:
    """Sweep until no value changes by more than the tolerance.

    After 10,000 sweeps a change of `TOLERANCE` suffices.

    Args:
        sweep: from a table to the next one and the largest change of a value.
        table: the first table.
        report: gets the progress after each sweep.
        tolerance: largest change in the last sweep.
    """
    residual = first = float("inf")
    for number in range(1, _MOST_SWEEPS + 1):
        table, change = sweep(table)
        residual = float(change)
        first = residual if number == 1 else first
        if report:
            report(Sweep(number, residual, _share_done(first, residual, tolerance)))
        if residual <= (tolerance if number < _MOST_SWEEPS else max(tolerance, TOLERANCE)):
            return Solved(table, number, residual)
    raise RuntimeError(f"value iteration still moves by {residual:g} after {_MOST_SWEEPS} sweeps")


def _share_done(first: float, residual: float, tolerance: float) -> float:
    """Return the share of a solution that is done, as residuals fall by a factor each time."""
    goal = max(tolerance, _ROUNDING)
    total = log(max(first, goal) / goal)
    return 1 - log(max(residual, goal) / goal) / total if total > 0 else 1.0


def lanes_of(grid: Grid) -> int:
    """Return the number of nodes that share a tile: the divisor of all that comes closest to
    `_LANES`.
    """
    divisors = [count for count in range(1, grid.size + 1) if grid.size % count == 0]
    return min(divisors, key=lambda count: abs(log(count / _LANES)))
