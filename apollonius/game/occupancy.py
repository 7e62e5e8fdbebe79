"""An occupancy map as an obstacle: how far a place is from its occupied cells, by a field of distances."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from apollonius.game.obstacle import AbstractObstacle
from apollonius.game.types import Real, RobotState, Scalar
from apollonius.io.errors import require

_ROUNDING = 0.15
"""What bilinear interpolation can add to a distance, in cells: 0.146, near a lone corner of an occupied cell."""
_PARTS = 4
"""Parts of a step at whose ends the field is looked up."""


class OccupancyMap(AbstractObstacle):
    """Square cells, occupied or free, and the distance from those that are occupied.

    The field is exact at the cells' corners, as the nearest point of an occupied square from there is a corner too.
    Between them it is interpolated, and lowered by as much as that can be too high. So in the free cells a clearance
    is never more than the distance from the nearest occupied cell; it is less by 0.15 cells beside a long wall and by
    0.86 at most. In occupied cells it is negative, and in gaps of one cell between them too.

    Attributes:
        field: distance [m] of each corner from the occupied cells, the first row at the bottom; in their midst minus
            the distance from the free cells, the longer of its two parts along x and y.
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
        return self.x + (self.field.shape[1] - 1) * self.cell

    @property
    def y_max(self) -> Real:
        """The upper end [m]."""
        return self.y + (self.field.shape[0] - 1) * self.cell

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Distance [m] from a point to the nearest occupied cell, rather too short than too long; negative inside."""
        rows, columns = self._corners
        column, right = beside((x - self.x) / self.cell, columns)
        row, up = beside((y - self.y) / self.cell, rows)
        below = (1 - right) * self._at(row, column) + right * self._at(row, column + 1)
        above = (1 - right) * self._at(row + 1, column) + right * self._at(row + 1, column + 1)
        return (1 - up) * below + up * above - _ROUNDING * self.cell

    @property
    def _corners(self) -> tuple[int | Int[Array, ""], int | Int[Array, ""]]:
        """Rows and columns of corners."""
        rows, columns = self.field.shape
        return rows, columns

    def _at(self, row: Int[Array, ""], column: Int[Array, ""]) -> Scalar:
        """The distance at a corner [m]."""
        return self.field[row, column]

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """No more than the least clearance [m] on the segment between two states.

        The field is looked up at five places. Between two of them a distance is less than at both by half their own
        distance from each other at most, so what is returned is too short by an eighth of the step at most.
        """
        shares = jnp.arange(_PARTS + 1) / _PARTS
        x, y = before.x + shares * (after.x - before.x), before.y + shares * (after.y - before.y)
        there = jax.vmap(self.clearance)(x, y)
        apart = jnp.hypot(after.x - before.x, after.y - before.y) / _PARTS
        return jnp.minimum(jnp.min(there), jnp.min(there[1:] + there[:-1] - apart) / 2)

    def occupied(self) -> Bool[np.ndarray, "rows columns"]:
        """The cells that are occupied, the first row at the bottom."""
        corners = np.asarray(self.field)
        return (corners[1:, 1:] + corners[1:, :-1] + corners[:-1, 1:] + corners[:-1, :-1]) <= 0


def beside(position: Scalar, corners: int | Int[Array, ""]) -> tuple[Int[Array, ""], Scalar]:
    """The corner before a place along one axis, and how far the place is on the way to the next; at most the ends."""
    inside = jnp.clip(position, 0.0, corners - 1.0)
    before = jnp.clip(jnp.floor(inside), 0.0, corners - 2.0)
    return before.astype(jnp.int32), inside - before


def distance_field(occupied: Bool[np.ndarray, "rows columns"], cell: float) -> Float[np.ndarray, "corners_y corners_x"]:
    """The field of distances [m] at the corners of cells.

    Raises:
        InvalidInput: unless there are free cells.
    """
    from scipy.ndimage import distance_transform_cdt, distance_transform_edt

    require(not occupied.all(), "map", "all occupied", "a map with free cells; mind negate and free_thresh")
    field = np.zeros([count + 1 for count in occupied.shape], np.float32)
    if occupied.any():
        field += np.asarray(distance_transform_edt(~_corners_of(occupied)))
        field -= np.asarray(distance_transform_cdt(~_corners_of(~occupied), metric="chessboard"))
    else:
        field += np.float32(np.hypot(*field.shape))
    return field * np.float32(cell)


def _corners_of(cells: Bool[np.ndarray, "rows columns"]) -> Bool[np.ndarray, "corners_y corners_x"]:
    """Which corners belong to at least one of these cells."""
    wide = np.pad(cells, 1)
    return wide[1:, 1:] | wide[1:, :-1] | wide[:-1, 1:] | wide[:-1, :-1]
