"""An occupancy map as an obstacle: a field of distances from its occupied cells."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from apollonius.game.obstacle import AbstractObstacle, Walls, between_nodes, bilinear
from apollonius.game.types import Flag, Real, RobotState, Scalar
from apollonius.io.errors import require

_ROUNDING = 0.15
"""Largest error that bilinear interpolation adds to a distance, in cells: 0.146, near a lone corner
of an occupied cell.
"""


class _Walk(NamedTuple):
    """A walk along a segment: its cell, the shares of the segment up to the next ones along x and
    y, and whether the cell is occupied.
    """

    row: Scalar
    column: Scalar
    next_x: Scalar
    next_y: Scalar
    is_occupied: Flag


class OccupancyMap(AbstractObstacle):
    """Square cells, occupied or free, with the distance from the occupied ones.

    The field is exact at the cells' corners, as the nearest point of an occupied square from there
    is a corner too. Between them it is interpolated, and lowered by as much as that can be too
    high. So in the free cells a clearance is never more than the distance from the nearest occupied
    cell; it is less by 0.15 cells beside a long wall and by 0.86 at most. In occupied cells it is
    negative, and in gaps of one cell between them too.

    Attributes:
        field: distance [m] of each corner from the occupied cells, the first row at the bottom; in
            their midst minus the distance from the free cells, the longer of its two parts along x
            and y.
        x, y: the lower left corner [m].
        cell: side of a cell [m].
        file: the map's YAML file.
        digest: SHA-256 of that file and its image.
    """

    field: Float[Array, "rows columns"]
    x: Real
    y: Real
    cell: Real
    file: str = eqx.field(static=True)
    digest: str = eqx.field(static=True)

    @property
    def x_max(self) -> Real:
        """The right end [m]."""
        return self.x + (self.field.shape[-1] - 1) * self.cell

    @property
    def y_max(self) -> Real:
        """The upper end [m]."""
        return self.y + (self.field.shape[-2] - 1) * self.cell

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Return the distance [m] from a point to the nearest occupied cell, never too long;
        negative inside.
        """
        rows, columns = self._corners
        across = between_nodes((x - self.x) / self.cell, columns)
        return (
            bilinear(self._at, across, between_nodes((y - self.y) / self.cell, rows))
            - _ROUNDING * self.cell
        )

    @property
    def _corners(self) -> tuple[int | Int[Array, ""], int | Int[Array, ""]]:
        """Rows and columns of corners."""
        rows, columns = self.field.shape[-2:]
        return rows, columns

    def _at(self, row: Int[Array, ""], column: Int[Array, ""]) -> Scalar:
        """Return the distance at a corner [m]."""
        return self.field[row, column]

    def hides(self, observer: RobotState, target: RobotState) -> Flag:
        """Check whether the segment between two robots' centres meets an occupied cell.

        The cells that it crosses are looked at one by one (Amanatides and Woo, "A fast voxel
        traversal algorithm for ray tracing", 1987).
        """
        rows, columns = self._corners
        start_x, start_y = (observer.x - self.x) / self.cell, (observer.y - self.y) / self.cell
        along_x, along_y = (target.x - observer.x) / self.cell, (target.y - observer.y) / self.cell

        def axis(start: Scalar, along: Scalar) -> tuple[Scalar, Scalar, Scalar]:
            """Return the first cell, the share of the segment that lies in it, and the share that
            each further cell takes.
            """
            first, slope = jnp.floor(start), 1 / jnp.maximum(jnp.abs(along), 1e-9)
            return first, jnp.where(along > 0, first + 1 - start, start - first) * slope, slope

        column, next_x, slope_x = axis(start_x, along_x)
        row, next_y, slope_y = axis(start_y, along_y)

        def is_occupied(row: Scalar, column: Scalar) -> Flag:
            low = jnp.clip(row, 0, rows - 2.0).astype(jnp.int32)
            left = jnp.clip(column, 0, columns - 2.0).astype(jnp.int32)
            corners = [self._at(low + up, left + right) for up in (0, 1) for right in (0, 1)]
            return jnp.sum(jnp.stack(corners)) <= 0

        def one_cell(walk: _Walk) -> _Walk:
            across = walk.next_x < walk.next_y
            column = jnp.where(across, walk.column + jnp.sign(along_x), walk.column)
            row = jnp.where(across, walk.row, walk.row + jnp.sign(along_y))
            share = jnp.minimum(walk.next_x, walk.next_y)
            next_x = jnp.where(across, walk.next_x + slope_x, walk.next_x)
            next_y = jnp.where(across, walk.next_y, walk.next_y + slope_y)
            occupied = (share < 1) & is_occupied(row, column)
            return _Walk(row, column, next_x, next_y, occupied)

        def should_continue(walk: _Walk) -> Flag:
            return ~walk.is_occupied & (jnp.minimum(walk.next_x, walk.next_y) < 1)

        start = _Walk(row, column, next_x, next_y, is_occupied(row, column))
        return jax.lax.while_loop(should_continue, one_cell, start).is_occupied

    def check(self, name: str, walls: Walls) -> None:
        """Refuse walls beyond the map's ends."""
        ends = Walls(self.x, self.x_max, self.y, self.y_max)
        low_is_inside = ends.enclose(walls.x_min, walls.y_min)
        is_covered = low_is_inside and ends.enclose(walls.x_max, walls.y_max)
        require(
            is_covered,
            "arena walls",
            walls.sides,
            f"within the map's ends {ends.sides}; leave them out to have those",
        )

    def occupied(self) -> Bool[np.ndarray, "rows columns"]:
        """Return the occupied cells, the first row at the bottom."""
        corners = np.asarray(self.field)
        return (corners[1:, 1:] + corners[1:, :-1] + corners[:-1, 1:] + corners[:-1, :-1]) <= 0


class OneOfMaps(OccupancyMap):
    """The map of one arena, by its number, in the field of several."""

    field: Float[Array, "arenas rows columns"]
    member: Int[Array, ""]

    def _at(self, row: Int[Array, ""], column: Int[Array, ""]) -> Scalar:
        return self.field[self.member, row, column]


def distance_field(
    occupied: Bool[np.ndarray, "rows columns"], cell: float
) -> Float[np.ndarray, "corners_y corners_x"]:
    """Return the field of distances [m] at the corners of cells; raises InvalidInput unless there
    are free cells.
    """
    from scipy.ndimage import distance_transform_cdt, distance_transform_edt

    require(
        not occupied.all(),
        "map",
        "all occupied",
        "a map with free cells; mind negate and free_thresh",
    )
    field = np.zeros([count + 1 for count in occupied.shape], np.float32)
    if occupied.any():
        field += np.asarray(distance_transform_edt(~_corners_of(occupied)))
        field -= np.asarray(distance_transform_cdt(~_corners_of(~occupied), metric="chessboard"))
    else:
        field += np.float32(np.hypot(*field.shape))
    return field * np.float32(cell)


def _corners_of(cells: Bool[np.ndarray, "rows columns"]) -> Bool[np.ndarray, "corners_y corners_x"]:
    """Return the corners that belong to at least one of these cells."""
    wide = np.pad(cells, 1)
    return wide[1:, 1:] | wide[1:, :-1] | wide[:-1, 1:] | wide[:-1, :-1]
