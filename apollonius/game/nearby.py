"""The polygons within reach of a robot: only these can touch it on its way."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from apollonius.game.polygon import Edge, Edges, Polygon
from apollonius.game.types import Real, Scalar
from apollonius.io.kept import Kept

_CELLS = 64
"""Cells along the longer side of the indexed rectangle."""
_ROUNDING = 1e-3
"""Addition to a reach [m], many times the rounding of single precision."""


class Surroundings(eqx.Module):
    """For each square cell of a rectangle, by its lower left corner and the side of a cell [m], the polygons within
    reach from anywhere in it: the numbers of their edges, padded with that of a last one which is far from everywhere.
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
    polygons: Sequence[Polygon], reach: float, x_min: float, x_max: float, y_min: float, y_max: float
) -> Surroundings:
    """Index polygons for a rectangle [m], by a reach [m]."""
    edges = _edges_of(tuple(polygons))
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
    within = jnp.asarray(filled.reshape(rows, columns, most))
    return Surroundings(edges, within, *map(jnp.float32, (x_min, y_min, cell)))


@Kept
def _edges_of(polygons: tuple[Polygon, ...]) -> Edge:
    return Edges.of(polygons).edges


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
