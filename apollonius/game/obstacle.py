"""The interface of obstacles (clearance, contact along a straight step), the walls, and
interpolation on grids.
"""

from abc import abstractmethod
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int

from apollonius.game.types import Flag, Real, RobotState, Scalar

_PARTS = 4
"""Parts of a segment, at whose ends a clearance is taken."""


def closest_approach_squared(px: Scalar, py: Scalar, dx: Real, dy: Real) -> Scalar:
    """Return the squared distance [m^2] from the origin to the segment from (px, py) to (px + dx,
    py + dy).
    """
    length_squared = dx * dx + dy * dy
    fraction = jnp.clip(-(px * dx + py * dy) / jnp.maximum(length_squared, 1e-12), 0.0, 1.0)
    nearest_x = px + fraction * dx
    nearest_y = py + fraction * dy
    return nearest_x * nearest_x + nearest_y * nearest_y


Between = tuple[Int[Array, ""], Scalar]
"""A position along one axis of a grid: the node before it, and the weight of the next one."""


def between_nodes(position: Scalar, nodes: int | Int[Array, ""]) -> Between:
    """Convert a position to nodes; clipped to the first and the last."""
    inside = jnp.clip(position, 0.0, nodes - 1.0)
    before = jnp.clip(jnp.floor(inside), 0.0, nodes - 2.0)
    return before.astype(jnp.int32), inside - before


def bilinear(
    value: Callable[[Int[Array, ""], Int[Array, ""]], Scalar], across: Between, upwards: Between
) -> Scalar:
    """Interpolate between a grid's values, a function of row and column."""
    (column, right), (row, up) = across, upwards
    below = (1 - right) * value(row, column) + right * value(row, column + 1)
    above = (1 - right) * value(row + 1, column) + right * value(row + 1, column + 1)
    return (1 - up) * below + up * above


class Walls(eqx.Module):
    """A rectangle that no robot may leave [m]."""

    x_min: Real = 0.0
    x_max: Real = 10.0
    y_min: Real = 0.0
    y_max: Real = 10.0

    def enclose(self, x: Real, y: Real) -> bool:
        return bool(self.x_min <= x <= self.x_max and self.y_min <= y <= self.y_max)

    @property
    def sides(self) -> str:
        """The rectangle in words."""
        return f"[{self.x_min}, {self.x_max}] x [{self.y_min}, {self.y_max}] m"


Corners = tuple[tuple[Real, Real], ...]
"""Corners x, y [m] of a shape with straight edges, in order."""


class AbstractObstacle(eqx.Module):
    """Something that no robot may touch. Its numbers are data; only the shapes of its arrays are
    static.
    """

    @abstractmethod
    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Return the distance [m] from a point; negative inside."""

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Return a lower bound of the clearance [m] on the segment between two states.

        The clearance is taken at five points. Between two neighbours a distance is less than at
        both by at most half their own distance, so the result is too short by at most an eighth of
        the step. Kinds with a formula for it have their own.
        """
        shares = jnp.arange(_PARTS + 1) / _PARTS
        x, y = before.x + shares * (after.x - before.x), before.y + shares * (after.y - before.y)
        clearances = jax.vmap(self.clearance)(x, y)
        spacing = jnp.hypot(after.x - before.x, after.y - before.y) / _PARTS
        return jnp.minimum(
            jnp.min(clearances), jnp.min(clearances[1:] + clearances[:-1] - spacing) / 2
        )

    def is_hit(self, before: RobotState, after: RobotState, radius: Real) -> Flag:
        """Check whether a body of this radius [m] touches it anywhere along the segment between two
        states.
        """
        return self.clearance_along(before, after) < radius

    def hides(self, observer: RobotState, target: RobotState) -> Flag:
        """Check whether it is in the line of sight between two robots' centres."""
        return self.is_hit(observer, target, 0.0)

    def outline(self) -> Corners:
        """Return its shape for pictures, unless it is a disc or a map; without corners it is not
        drawn.
        """
        return ()

    def check(self, name: str, walls: Walls) -> None:
        """Refuse an impossible one."""
