"""Where the robots are: walls (Eq. 2), circular obstacles, and whether a step along a segment touches them."""

import functools

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool

from apollonius.game.types import Real, RobotState, Scalar


def closest_approach_squared(px: Scalar, py: Scalar, dx: Scalar, dy: Scalar) -> Scalar:
    """Squared distance [m^2] from the origin to the segment from (px, py) to (px + dx, py + dy)."""
    length_squared = dx * dx + dy * dy
    fraction = jnp.clip(-(px * dx + py * dy) / jnp.maximum(length_squared, 1e-12), 0.0, 1.0)
    nearest_x = px + fraction * dx
    nearest_y = py + fraction * dy
    return nearest_x * nearest_x + nearest_y * nearest_y


class Disc(eqx.Module):
    """A circular obstacle: centre (x, y) and radius [m]."""

    x: Real
    y: Real
    radius: Real


class Arena(eqx.Module):
    """A rectangle with discs in it. The number of discs is static, everything else is data.

    Attributes:
        x_min, x_max, y_min, y_max: the walls [m].
        discs: the obstacles.
    """

    x_min: Real = 0.0
    x_max: Real = 10.0
    y_min: Real = 0.0
    y_max: Real = 10.0
    discs: tuple[Disc, ...] = ()

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Distance [m] from a point to the nearest wall or disc; negative outside the walls or inside a disc."""
        return functools.reduce(jnp.minimum, self.clearances(x, y))

    def clearances(self, x: Scalar, y: Scalar) -> list[Scalar]:
        """Distance [m] from a point to each of the four walls, then to each disc; negative on the wrong side."""
        return [x - self.x_min, self.x_max - x, y - self.y_min, self.y_max - y, *self._to_discs(x, y)]

    def to_obstacles(self, x: Scalar, y: Scalar) -> Scalar:
        """Distance [m] from a point to the nearest disc; negative inside it. There must be one."""
        return functools.reduce(jnp.minimum, self._to_discs(x, y))

    def _to_discs(self, x: Scalar, y: Scalar) -> list[Scalar]:
        return [jnp.hypot(x - disc.x, y - disc.y) - disc.radius for disc in self.discs]

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Least clearance [m] on the segment between two states."""
        least = jnp.minimum(self._to_walls(before.x, before.y), self._to_walls(after.x, after.y))
        dx, dy = after.x - before.x, after.y - before.y
        for disc in self.discs:
            approach = closest_approach_squared(before.x - disc.x, before.y - disc.y, dx, dy)
            least = jnp.minimum(least, jnp.sqrt(approach) - disc.radius)
        return least

    def _to_walls(self, x: Scalar, y: Scalar) -> Scalar:
        return jnp.minimum(jnp.minimum(x - self.x_min, self.x_max - x), jnp.minimum(y - self.y_min, self.y_max - y))

    def hits_obstacle(self, before: RobotState, after: RobotState, radius: Real) -> Bool[Array, ""]:
        """Whether a body of this radius [m] touches a disc anywhere along the segment between two states."""
        dx, dy = after.x - before.x, after.y - before.y
        hit = jnp.zeros((), bool)
        for disc in self.discs:
            approach = closest_approach_squared(before.x - disc.x, before.y - disc.y, dx, dy)
            hit = hit | (approach < (disc.radius + radius) ** 2)
        return hit

    def is_out_of_range(self, after: RobotState, radius: Real) -> Bool[Array, ""]:
        """Whether a body of this radius [m] reaches beyond a wall (Eq. 2).

        The walls bound a convex region, so a segment that starts inside leaves it only if its end does.
        """
        return (
            (after.x - radius < self.x_min)
            | (after.x + radius > self.x_max)
            | (after.y - radius < self.y_min)
            | (after.y + radius > self.y_max)
        )
