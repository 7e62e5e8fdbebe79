"""Things within reach of a place, looked up by the cell that the place is in."""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

_CELLS = 64
"""Cells along each side of a square; half as many, and so on, if the lists of all cells would have
more than `_MOST` numbers.
"""
_MOST = 2**24
_FEW = 8
"""Lists are as long as a multiple of this, so that few programs serve many squares."""
_ROUNDING = 1e-3
"""Addition to a reach [m], many times the rounding of single precision."""


class NearbyIndex(eqx.Module):
    """For each cell of several squares the numbers of the things within reach from anywhere in it.

    Attributes:
        within: the numbers, padded with that of a thing far from everywhere.
        x, y: the lower left corners of the squares [m].
        cell: the sides of their cells [m].
    """

    within: Int[Array, "squares rows columns near"]
    x: Float[Array, " squares"]
    y: Float[Array, " squares"]
    cell: Float[Array, " squares"]

    def near(
        self, square: Int[Array, ""] | int, x: Float[Array, ""], y: Float[Array, ""]
    ) -> Int[Array, " near"]:
        """Return the numbers of all things within reach from a point, and maybe of more."""
        last, cell = self.within.shape[1] - 1, self.cell[square]
        row = jnp.clip(jnp.floor((y - self.y[square]) / cell).astype(jnp.int32), 0, last)
        column = jnp.clip(jnp.floor((x - self.x[square]) / cell).astype(jnp.int32), 0, last)
        return self.within[square, row, column]


def index_nearby(
    distances: Callable[[int, Array, Array], Float[np.ndarray, "things rows columns"]],
    reach: float,
    x: Float[np.ndarray, " squares"],
    y: Float[np.ndarray, " squares"],
    side: Float[np.ndarray, " squares"],
    cells: int = _CELLS,
) -> NearbyIndex:
    """Index things by the cells of squares.

    They are numbered throughout: as many of each square, one square after the other, and at last
    one that is far from everywhere.

    Args:
        distances: the function from a square's number, the x of columns and the y of rows to the
            distances [m] of its things from where they meet.
        reach: distance [m] up to which a thing counts as near.
        x, y, side: the lower left corners of the squares, and their sides [m].
        cells: number of cells along a side, at most.
    """
    cell, middles = side / cells, np.arange(cells) + 0.5
    things, lists = 0, list[tuple[np.ndarray, ...]]()
    for square, size in enumerate(cell):
        columns, rows = (jnp.float32(corner[square] + size * middles) for corner in (x, y))
        away = distances(square, columns, rows)
        is_near = away <= reach + size / np.sqrt(2) + _ROUNDING
        things = len(away)
        row, column, number = np.nonzero(np.moveaxis(is_near, 0, 2))
        before = np.cumsum(is_near.sum(axis=0)).reshape(cells, cells) - is_near.sum(axis=0)
        lists.append((row, column, np.arange(len(row)) - before[row, column], number))
    longest = 1 + max(int(place.max(initial=0)) for _, _, place, _ in lists)
    near = _FEW * -(-longest // _FEW)
    if cells > 1 and len(lists) * cells * cells * near > _MOST:
        return index_nearby(distances, reach, x, y, side, cells // 2)
    within = np.full((len(lists), cells, cells, near), len(lists) * things, np.int32)
    for square, (row, column, place, number) in enumerate(lists):
        within[square, row, column, place] = square * things + number
    return NearbyIndex(jnp.asarray(within), *map(jnp.float32, (x, y, cell)))
