"""The polygons within reach of a robot: only these can touch it on its way."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from apollonius.game.polygon import Edge, Edges, Polygon
from apollonius.game.types import Real, Scalar

_CELLS = 64
"""Cells along the longer side of the indexed rectangle."""
_ROUNDING = 1e-3
"""Addition to a reach [m], many times the rounding of single precision."""
_FAR = 1e6
"""Coordinates of what is far from everywhere [m]."""

_edges_of = jax.jit(Edges.of)
_clearances = jax.jit(jax.vmap(jax.vmap(Polygon.clearance, (None, 0, None)), (None, None, 0)))


class Surroundings(eqx.Module):
    """For each square cell of a rectangle, by its lower left corner and the side of a cell [m], the
    polygons within reach from anywhere in it: the numbers of their edges, padded with that of a
    last one which is far from everywhere.
    """

    edges: Edge
    within: Int[Array, "rows columns edges"]
    x: Real
    y: Real
    cell: Real

    def near(self, x: Scalar, y: Scalar) -> Edges:
        """Return the edges of all polygons within reach from a point, and maybe more."""
        rows, columns, _ = self.within.shape
        row = jnp.clip(jnp.floor((y - self.y) / self.cell).astype(jnp.int32), 0, rows - 1)
        column = jnp.clip(jnp.floor((x - self.x) / self.cell).astype(jnp.int32), 0, columns - 1)
        numbers = self.within[row, column]
        return Edges(jax.tree.map(lambda leaf: leaf[numbers], self.edges))


def surroundings(
    polygons: Sequence[Polygon],
    reach: float,
    x_min: float,
    x_max: float,
    y_min: float,
    y_max: float,
) -> Surroundings:
    """Index polygons by the cells of a rectangle.

    Args:
        polygons: one at least.
        reach: distance [m] up to which a polygon counts as near.
        x_min, x_max, y_min, y_max: the rectangle [m].
    """
    far_polygon = Polygon(((_FAR, _FAR),) * len(polygons[-1].vertices))
    cell = max(x_max - x_min, y_max - y_min) / _CELLS
    columns = max(1, int(np.ceil((x_max - x_min) / cell)))
    rows = max(1, int(np.ceil((y_max - y_min) / cell)))
    x = jnp.float32(x_min + cell * (np.arange(columns) + 0.5))
    y = jnp.float32(y_min + cell * (np.arange(rows) + 0.5))
    max_distance = reach + cell / np.sqrt(2) + _ROUNDING
    numbers: list[list[int]] = [[] for _ in range(rows * columns)]
    first = 0
    for polygon in polygons:
        last = first + len(polygon.vertices)
        for index in np.flatnonzero(np.asarray(_clearances(polygon, x, y)) <= max_distance):
            numbers[index] += range(first, last)
        first = last
    longest = max(1, max(map(len, numbers)))
    rows_of_edges = np.array(
        [[*edges, *[first] * (longest - len(edges))] for edges in numbers], np.int32
    )
    within = jnp.asarray(rows_of_edges.reshape(rows, columns, longest))
    edges = jax.tree.map(lambda leaf: leaf[: first + 1], _edges_of((*polygons, far_polygon)).edges)
    return Surroundings(edges, within, *map(jnp.float32, (x_min, y_min, cell)))
