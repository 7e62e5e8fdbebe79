"""The chart of an arena: its clearances, and the lengths of all shortest paths between the cells of
a coarse grid.

A chart is drawn once (`apollonius.arenas.charting`). Players read it, and the reward of progress
along paths, but no rule does. The table of all paths between some places has one size; in a large
arena these are hubs, and each coarse cell knows its ways to the nearest ones.
"""

import functools
import math
import operator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt, UInt16, UInt32

from apollonius.game.obstacle import between_nodes, bilinear
from apollonius.game.types import Flag, Scalar

SIDE = 192
"""Cells of the field of clearances along the arena's longer side."""
COARSE = 40
"""Cells of the coarse grid along the longer side, between whose middles path lengths are known."""
LARGE_SIDE, LARGE_COARSE = 512, 256
"""Cells of the field and of the coarse grid along the longer side of a large arena."""
COARSE_BITS, LARGE_COARSE_BITS = 11, 27
"""Bits of the number of a coarse cell."""
_STEP = 2
"""Longest step between coarse cells, in columns and in rows."""
_RANGE = range(-_STEP, _STEP + 1)
STEPS = tuple((right, up) for up in _RANGE for right in _RANGE if (right, up) != (0, 0))
"""Steps, in columns and rows, between coarse cells of which one can be entered from the other."""
NO_PATH = 2**16 - 1
"""Length of a missing path [cm]."""
MAX_RAY_STEPS = 12
"""Steps of a ray: each is as long as the clearance at the end of the one before."""
MAX_RANGE = 12.0
"""Length of rays that meet nothing [m], on the scale of the arenas in which agents learned."""

CellWeights = tuple[Int[Array, "4"], Float[Array, "4"]]
"""The four coarse cells around a point, and their weights."""


class Hubs(eqx.Module):
    """The hubs nearest to each coarse cell of large arenas.

    Attributes:
        number: of each of these hubs.
        length: of the shortest path there [cm]; `NO_PATH` if there are fewer hubs.
    """

    number: UInt16[Array, "arenas coarse nearest"]
    length: UInt16[Array, "arenas coarse nearest"]


class Chart(eqx.Module):
    """Charts of one or several arenas, squares on their lower left corners with sides as long as
    their longer ones.

    Attributes:
        field: distance [m] from walls and obstacles at the corners of `SIDE` by `SIDE` cells
            (`LARGE_SIDE`), the first row at the bottom; negative beyond them.
        lengths: of the shortest paths between hubs [cm]: between the middles of all coarse cells
            unless there are `hubs`.
        visible: for each cell of the field the coarse cell with the shortest path to it (the lower
            `COARSE_BITS` bits, or `LARGE_COARSE_BITS`), and which of the four around its middle can
            be seen from there: the next bits stand for those at its lower left, lower right, upper
            left and upper right. The number of a coarse cell is `row * columns + column`.
        x, y: the lower left corners [m].
        side: lengths of the sides [m].
        links: for each coarse cell the steps by which a robot can come into it, a bit for each of
            `STEPS`; a point belongs to the coarse cell with the shortest path to it. None in
            exports.
        hubs: the hubs of large arenas.
        member: index of the arena.
    """

    field: Float[Array, "arenas corners corners"]
    lengths: UInt16[Array, "arenas hubs hubs"]
    visible: UInt[Array, "arenas cells cells"]
    x: Float[Array, " arenas"]
    y: Float[Array, " arenas"]
    side: Float[Array, " arenas"]
    links: UInt32[Array, "arenas rows columns"] | None = None
    hubs: Hubs | None = None
    member: Int[Array, ""] | int = 0

    @property
    def columns(self) -> int:
        """Coarse cells along a side."""
        table = self.lengths if self.hubs is None else self.hubs.number
        return math.isqrt(table.shape[1])

    @property
    def coarse_cell(self) -> Scalar:
        """The side of a coarse cell [m]."""
        return self.side[self.member] / self.columns

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Return the distance [m] from a point to the nearest wall or obstacle, interpolated;
        negative beyond.
        """
        member, corners = self.member, self.field.shape[-1]
        cell = self.side[member] / (corners - 1)
        across = between_nodes((x - self.x[member]) / cell, corners)
        upwards = between_nodes((y - self.y[member]) / cell, corners)
        return bilinear(lambda row, column: self.field[member, row, column], across, upwards)

    def range(self, x: Scalar, y: Scalar, cos: Scalar, sin: Scalar) -> Scalar:
        """Return the distance [m] from a point to the first wall or obstacle in a direction.

        Sphere tracing (Hart, 1996) with `MAX_RAY_STEPS` steps: along a long wall the distance is
        too short.

        Args:
            x, y: the point [m].
            cos, sin: cosine and sine of the direction.

        Returns at most `MAX_RANGE`.
        """

        def one_step(_: Int[Array, ""], distance: Scalar) -> Scalar:
            return jnp.minimum(
                distance + jnp.maximum(self.clearance(x + distance * cos, y + distance * sin), 0.0),
                MAX_RANGE,
            )

        return jax.lax.fori_loop(0, MAX_RAY_STEPS, one_step, jnp.zeros_like(x))

    def cell_weights(self, x: Scalar, y: Scalar) -> CellWeights:
        """Return the coarse cells around a point that can be seen from there, with bilinear
        weights.

        Where none can be seen it is the nearest one alone.
        """
        columns, side_cells = self.columns, self.visible.shape[-1]
        shares = self._shares(x, y)
        cells = [_cell_at(share, side_cells) for share in shares]
        (left, right), (low, up) = (
            _between((cell + 0.5) / side_cells, share, columns)
            for cell, share in zip(cells, shares, strict=True)
        )
        first = low * columns + left
        around = jnp.stack([first, first + 1, first + columns, first + columns + 1])
        weights = jnp.stack(
            [(1 - right) * (1 - up), right * (1 - up), (1 - right) * up, right * up]
        )
        entry = self._entry(x, y)
        bits = cell_bits(self.visible.dtype)
        visible = (entry >> (bits + jnp.arange(4, dtype=jnp.int32))) & 1
        weights = (weights + 1e-3) * visible.astype(jnp.float32)
        total = jnp.sum(weights)
        nearest = _number(entry, bits)
        nearest_only = jnp.array([1.0, 0.0, 0.0, 0.0])
        no_cell = total == 0
        coarse_cells = jnp.where(no_cell, nearest, around)
        shares = weights / jnp.where(no_cell, 1.0, total)
        return coarse_cells, jnp.where(no_cell, nearest_only, shares)

    def nearest_cell(self, x: Scalar, y: Scalar) -> Int[Array, ""]:
        """Return the number of the coarse cell with the shortest path to a point."""
        return _number(self._entry(x, y), cell_bits(self.visible.dtype))

    def _shares(self, x: Scalar, y: Scalar) -> tuple[Scalar, Scalar]:
        """Return a point's coordinates as shares of the side."""
        side = self.side[self.member]
        return (x - self.x[self.member]) / side, (y - self.y[self.member]) / side

    def _entry(self, x: Scalar, y: Scalar) -> Int[Array, ""]:
        """Return the entry of `visible` at a point."""
        side_cells = self.visible.shape[-1]
        column, row = (
            _cell_at(share, side_cells).astype(jnp.int32) for share in self._shares(x, y)
        )
        return self.visible[self.member, row, column].astype(jnp.int32)

    def middles(self) -> tuple[Float[Array, "1 columns"], Float[Array, "rows 1"]]:
        """Return x and y [m] of the coarse cells' middles."""
        columns = self.columns
        middles = (jnp.arange(columns, dtype=jnp.float32) + 0.5) * self.side[self.member] / columns
        return (self.x[self.member] + middles)[None, :], (self.y[self.member] + middles)[:, None]

    def lengths_between(
        self, starts: Int[Array, " starts"], ends: Int[Array, " ends"]
    ) -> Float[Array, "starts ends"]:
        """Return the lengths of the shortest paths between coarse cells [cm]; `NO_PATH` without
        one.
        """
        if self.hubs is None:
            return self.lengths[self.member, starts[:, None], ends[None, :]].astype(jnp.float32)
        hubs, member = self.hubs, self.member

        def lengths_from(start: Int[Array, ""]) -> Float[Array, " ends"]:
            beside = self.lengths[member, hubs.number[member, start]]
            to_hubs = jnp.min(_add(hubs.length[member, start][:, None], beside), axis=0)
            over_hubs = _add(hubs.length[member, ends], to_hubs[hubs.number[member, ends]])
            return jnp.min(over_hubs, axis=1)

        return jax.vmap(lengths_from)(starts)

    def path_length(self, start: CellWeights, end: CellWeights) -> Scalar:
        """Return the length [m] of the shortest path between two points, to about half a coarse
        cell.
        """
        (starts, start_weights), (ends, end_weights) = start, end
        lengths = self.lengths_between(starts, ends)
        return jnp.sum(start_weights[:, None] * lengths * end_weights[None, :]) / 100

    def has_line_of_sight(
        self, x: Scalar, y: Scalar, dx: Scalar, dy: Scalar, distance: Scalar
    ) -> Flag:
        """Check whether a straight line between two points meets no obstacle.

        Args:
            x, y: the first point [m].
            dx, dy: vector from it to the second [m].
            distance: length of that vector [m].
        """
        far = jnp.maximum(distance, 1e-6)
        return self.range(x, y, dx / far, dy / far) >= jnp.minimum(distance, MAX_RANGE)

    def shortest_path_length(self, x: Scalar, y: Scalar, to_x: Scalar, to_y: Scalar) -> Scalar:
        """Return the length [m] of the shortest path between two points; infinite without a path.

        If no obstacle is between them, it is their distance.

        Args:
            x, y: the first point [m].
            to_x, to_y: the second point [m].
        """
        starts, start_weights = self.cell_weights(x, y)
        ends, end_weights = self.cell_weights(to_x, to_y)
        used = (start_weights[:, None] > 0) & (end_weights[None, :] > 0)
        missing = used & (self.lengths_between(starts, ends) == NO_PATH)
        path = jnp.where(
            jnp.any(missing),
            jnp.inf,
            self.path_length((starts, start_weights), (ends, end_weights)),
        )
        dx, dy = to_x - x, to_y - y
        straight = jnp.hypot(dx, dy)
        return jnp.where(self.has_line_of_sight(x, y, dx, dy, straight), straight, path)

    def lengths_from(self, x: Scalar, y: Scalar) -> Float[Array, "rows columns"]:
        """Return the lengths of the shortest paths from a point to all coarse cells [m]; infinite
        without one.
        """
        columns, cell = self.columns, self.nearest_cell(x, y)
        lengths = self.lengths_between(cell[None], jnp.arange(columns**2))[0]
        return jnp.where(lengths == NO_PATH, jnp.inf, lengths / 100).reshape(columns, columns)

    def path_length_from(self, cell: Int[Array, ""], end: CellWeights) -> Scalar:
        """Return the length [m] of the shortest path from a coarse cell's middle to a point."""
        cells, weights = end
        return jnp.sum(self.lengths_between(cell[None], cells)[0] * weights) / 100


def cell_bits(dtype: Any) -> int:
    """Return the number of the lower bits of `Chart.visible` that are for a coarse cell."""
    return COARSE_BITS if dtype == jnp.uint16 else LARGE_COARSE_BITS


def _number(entry: Array, bits: int) -> Int[Array, "..."]:
    """Return the numbers of coarse cells in entries of `Chart.visible`."""
    return entry & (2**bits - 1)


def _cell_at(share: Scalar, cells: int) -> Scalar:
    """Return the cell at a share of the side that is divided into some cells."""
    return jnp.clip(jnp.floor(share * cells), 0.0, cells - 1.0)


def _add(first: Array, second: Array) -> Array:
    """Return sums of lengths [cm], `NO_PATH` at most."""
    return jnp.minimum(first.astype(jnp.float32) + second.astype(jnp.float32), NO_PATH)


def _between(middle: Scalar, share: Scalar, columns: int) -> tuple[Int[Array, ""], Scalar]:
    """Return the coarse cell before a cell's middle along one axis, and the weight of the next one
    at a point; both are given as shares of the side.
    """
    before = jnp.clip(jnp.floor(middle * columns - 0.5), 0.0, columns - 2.0)
    return before.astype(jnp.int32), jnp.clip(share * columns - 0.5 - before, 0.0, 1.0)


@functools.partial(jax.jit, static_argnames="columns")
def entries(
    field: Float[Array, "corners corners"], visible: UInt[Array, "cells cells"], columns: int
) -> UInt32[Array, "coarse_rows coarse_columns"]:
    """Return `Chart.links`: from which coarse cells one is entered, as free cells of the field lie
    side by side.

    Args:
        field: clearances at the corners of cells [m].
        visible: as in `Chart.visible`.
        columns: coarse cells along a side.
    """
    coarse = _number(visible.astype(jnp.int32), cell_bits(visible.dtype))
    corners = field[1:, 1:], field[1:, :-1], field[:-1, 1:], field[:-1, :-1]
    cells = jnp.where(functools.reduce(jnp.maximum, corners) > 0, coarse, -1)  # -1: not free

    def one_row(
        links: Bool[Array, "steps coarse"], rows: tuple[Array, Array]
    ) -> tuple[Array, None]:
        row, next_row = rows
        starts = jnp.concatenate([row[:-1], row, row[:-1], row[1:]])
        ends = jnp.concatenate([row[1:], next_row, next_row[1:], next_row[:-1]])
        start, end = jnp.concatenate([starts, ends]), jnp.concatenate([ends, starts])
        across, upwards = end % columns - start % columns, end // columns - start // columns
        is_near = (jnp.abs(across) <= _STEP) & (jnp.abs(upwards) <= _STEP)
        is_step = (start >= 0) & (end >= 0) & is_near
        step = jnp.where(is_step, (upwards + _STEP) * (2 * _STEP + 1) + across + _STEP, 0)
        return links.at[step, end].max(is_step), None

    next_row = jnp.pad(cells[1:], ((0, 1), (0, 0)), constant_values=-1)
    no_links = jnp.zeros((len(STEPS) + 1, columns**2), bool)
    links, _ = jax.lax.scan(one_row, no_links, (cells, next_row))
    middle = len(STEPS) // 2
    rows_of_steps = [step + (step >= middle) for step in range(len(STEPS))]
    bits = [links[row].astype(jnp.uint32) << step for step, row in enumerate(rows_of_steps)]
    return functools.reduce(operator.or_, bits).reshape(columns, columns)
