"""Obstacles within reach of a place, looked up by the cell that the place is in."""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

T = TypeVar("T")
_CELLS = 64
"""Cells along the longer side of the indexed rectangle."""
_FEW = 8
"""Lists of things near a cell are as long as this times a power of two, so that few programs serve
many rectangles.
"""
_ROUNDING = 1e-3
"""Addition to a reach [m], many times the rounding of single precision."""


class NearbyIndex(eqx.Module, Generic[T]):
    """For each square cell of a rectangle the things within reach from anywhere in it.

    Attributes:
        things: leaves `[things]`; the last ones are far from everywhere.
        within: their numbers in each cell, padded with that of one far from everywhere.
        x, y: the rectangle's lower left corner [m].
        cell: the side of a cell [m].
    """

    things: T
    within: Int[Array, "rows columns near"]
    x: Float[Array, ""]
    y: Float[Array, ""]
    cell: Float[Array, ""]

    def near(self, x: Float[Array, ""], y: Float[Array, ""]) -> T:
        """Return all things within reach from a point, and maybe more."""
        rows, columns, _ = self.within.shape
        row = jnp.clip(jnp.floor((y - self.y) / self.cell).astype(jnp.int32), 0, rows - 1)
        column = jnp.clip(jnp.floor((x - self.x) / self.cell).astype(jnp.int32), 0, columns - 1)
        numbers = self.within[row, column]
        return jax.tree.map(lambda leaf: leaf[numbers], self.things)


def index_nearby(
    things: T,
    distances: Callable[[Array, Array], Float[Any, "things rows columns"]],
    reach: float,
    x_range: tuple[float, float],
    y_range: tuple[float, float],
) -> NearbyIndex[T]:
    """Index things by the cells of a rectangle.

    Args:
        things: leaves `[things]`; the last ones, one at least, are far from everywhere.
        distances: the function from the x of columns and the y of rows to the distances [m] of all
            things but these from where they meet.
        reach: distance [m] up to which a thing counts as near.
        x_range, y_range: the rectangle's ends [m].
    """
    (x_min, x_max), (y_min, y_max) = x_range, y_range
    cell = max(x_max - x_min, y_max - y_min) / _CELLS
    columns = max(1, int(np.ceil((x_max - x_min) / cell)))
    rows = max(1, int(np.ceil((y_max - y_min) / cell)))
    x = jnp.float32(x_min + cell * (np.arange(columns) + 0.5))
    y = jnp.float32(y_min + cell * (np.arange(rows) + 0.5))
    is_near = np.asarray(distances(x, y)) <= reach + cell / np.sqrt(2) + _ROUNDING
    needed, most = int(is_near.sum(axis=0).max()), _FEW
    while most < needed:
        most *= 2
    side = max(rows, columns)
    within = np.full((most, side, side), len(is_near), np.int32)
    number, row, column = np.nonzero(is_near)
    within[np.cumsum(is_near, axis=0)[number, row, column] - 1, row, column] = number
    return NearbyIndex(
        things, jnp.asarray(np.moveaxis(within, 0, 2)), *map(jnp.float32, (x_min, y_min, cell))
    )
