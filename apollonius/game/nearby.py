"""The polygons within reach of a robot: only these can touch it on its way."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from apollonius.game.polygon import PASSED_THROUGH, Edge, Polygon, edges_of
from apollonius.game.types import Real, RobotState, Scalar

_CELLS = 64
"""Cells along the longer side of the indexed rectangle."""
_ROUNDING = 1e-3
"""Addition to a reach [m], many times the rounding of single precision."""


class Edges(eqx.Module):
    """Edges, leaves `[edges]`, and one over the squared length of each [1/m^2]."""

    edge: Edge
    inverse: Float[Array, " edges"]

    def clearance_from(self, x: Scalar, y: Scalar) -> Scalar:
        """Return the distance [m] from a point to the nearest edge; negative inside a polygon."""
        here = RobotState(x, y, x, y)
        return self.clearance_along(here, here)

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Return the least clearance [m] on the segment between two states.

        It is that of `Polygons.clearance_along` without the clearance of the segment's start, which on a path is the
        end of another one.
        """
        segment = _Segment.between(before, after)
        return jax.lax.scan(lambda segment, edges: (segment.beside(edges), None), segment, self)[0].clearance


class _Segment(eqx.Module):
    """A segment among the edges so far.

    Attributes:
        per_length_squared: one over its squared length [1/m^2].
        from_end, from_corners: squared distances of its end from the nearest edge, and of the nearest corner [m^2].
        windings: of the edges around its end.
        crossed: whether an edge crosses it.
    """

    before: RobotState
    after: RobotState
    per_length_squared: Scalar
    from_end: Scalar
    from_corners: Scalar
    windings: Int[Array, ""]
    crossed: Bool[Array, ""]

    @classmethod
    def between(cls, before: RobotState, after: RobotState) -> "_Segment":
        """Return the segment without any edge."""
        length_squared = _squared(after.x - before.x, after.y - before.y)
        far = jnp.asarray(jnp.inf, jnp.float32)
        none, not_crossed = jnp.zeros((), jnp.int32), jnp.zeros((), bool)
        return cls(before, after, 1 / jnp.maximum(length_squared, 1e-12), far, far, none, not_crossed)

    def beside(self, edges: Edges) -> "_Segment":
        """Return the segment with one more edge."""
        edge = edges.edge
        dx, dy = self.after.x - self.before.x, self.after.y - self.before.y
        to_x, to_y = edge.x - self.after.x, edge.y - self.after.y
        share = jnp.clip(-(to_x * edge.along_x + to_y * edge.along_y) * edges.inverse, 0.0, 1.0)
        from_end = _squared(to_x + share * edge.along_x, to_y + share * edge.along_y)
        from_x, from_y = self.before.x - edge.x, self.before.y - edge.y
        share = jnp.clip(-(from_x * dx + from_y * dy) * self.per_length_squared, 0.0, 1.0)
        from_corner = _squared(from_x + share * dx, from_y + share * dy)
        return _Segment(
            self.before,
            self.after,
            self.per_length_squared,
            jnp.minimum(self.from_end, from_end),
            jnp.minimum(self.from_corners, from_corner),
            self.windings + edge.windings(self.after.x, self.after.y),
            self.crossed | edge.is_crossed(self.before, self.after),
        )

    @property
    def clearance(self) -> Scalar:
        """The least clearance [m]."""
        outside = jnp.where(self.crossed, PASSED_THROUGH, jnp.sqrt(jnp.minimum(self.from_end, self.from_corners)))
        return jnp.where(self.windings > 0, -jnp.sqrt(self.from_end), outside)


class Surroundings(eqx.Module):
    """For each square cell of a rectangle the polygons within reach from anywhere in it.

    Attributes:
        edges: the edges of all polygons, and a last one that is far from everywhere.
        within: for each cell the numbers of the edges of those polygons, padded with the last one.
        x, y: the lower left corner [m].
        cell: side of a cell [m].
    """

    edges: Edges
    within: Int[Array, "rows columns edges"]
    x: Real
    y: Real
    cell: Real

    def near(self, x: Scalar, y: Scalar) -> Edges:
        """Return the edges of all polygons within reach from a point, and maybe more; leaves `[edges]`."""
        rows, columns, _ = self.within.shape
        row = jnp.clip(jnp.floor((y - self.y) / self.cell).astype(jnp.int32), 0, rows - 1)
        column = jnp.clip(jnp.floor((x - self.x) / self.cell).astype(jnp.int32), 0, columns - 1)
        numbers = self.within[row, column]
        return jax.tree.map(lambda leaf: leaf[numbers], self.edges)


def surroundings(
    polygons: Sequence[Polygon], reach: float, x_min: float, x_max: float, y_min: float, y_max: float
) -> Surroundings:
    """Index polygons for a rectangle [m], by a reach [m]."""
    edges = edges_of(polygons)
    size = max(x_max - x_min, y_max - y_min)
    cell = size / _CELLS
    columns, rows = (max(1, int(np.ceil((high - low) / cell))) for low, high in ((x_min, x_max), (y_min, y_max)))
    middle_x = x_min + cell * (np.arange(columns) + 0.5)[None, :]
    middle_y = y_min + cell * (np.arange(rows) + 0.5)[:, None]
    far_enough = reach + cell / np.sqrt(2) + _ROUNDING
    numbers: list[list[int]] = [[] for _ in range(rows * columns)]
    first = 0
    for polygon in polygons:
        last = first + len(polygon.vertices)
        for index in np.flatnonzero(_is_within(edges, range(first, last), middle_x, middle_y, far_enough)):
            numbers[index] += range(first, last)
        first = last
    most = max(1, max(map(len, numbers)))
    filled = np.array([[*some, *[first] * (most - len(some))] for some in numbers], np.int32)
    far, one, none = (jnp.asarray([number], jnp.float32) for number in (1e6, 1.0, 0.0))
    away = jax.vmap(Edge)(far, far, one, none, jnp.asarray([1], jnp.int32))
    edges = jax.tree.map(lambda some, one: jnp.concatenate([some, one]), edges, away)
    inverse = 1 / jnp.maximum(edges.along_x**2 + edges.along_y**2, 1e-12)
    return Surroundings(
        Edges(edges, inverse), jnp.asarray(filled.reshape(rows, columns, most)), *map(jnp.float32, (x_min, y_min, cell))
    )


def _is_within(
    edges: Edge, numbers: range, x: Float[np.ndarray, "1 columns"], y: Float[np.ndarray, "rows 1"], reach: float
) -> Bool[np.ndarray, "rows columns"]:
    """Return whether points are in a polygon, given by its edges, or within reach of it [m]."""
    near, inside = np.zeros((y.size, x.size), bool), np.zeros((y.size, x.size), bool)
    for number in numbers:
        at_x, at_y, along_x, along_y = (
            float(leaf[number]) for leaf in map(np.asarray, (edges.x, edges.y, edges.along_x, edges.along_y))
        )
        share = ((x - at_x) * along_x + (y - at_y) * along_y) / max(along_x**2 + along_y**2, 1e-12)
        share = np.clip(share, 0, 1)
        near |= np.hypot(at_x + share * along_x - x, at_y + share * along_y - y) <= reach
        above = at_y > y
        crosses = (above != (at_y + along_y > y)) & ((along_x * (y - at_y) > along_y * (x - at_x)) != above)
        inside ^= crosses
    return near | inside


def _squared(x: Scalar, y: Scalar) -> Scalar:
    return x * x + y * y
