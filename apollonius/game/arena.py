"""Where the robots are: walls (Eq. 2), obstacles, and whether a step along a segment touches them."""

import functools

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool

from apollonius.game.occupancy import OccupancyMap
from apollonius.game.polygon import Polygon, clearance_along, clearance_from
from apollonius.game.segment import closest_approach_squared
from apollonius.game.types import Real, RobotState, Scalar


class Disc(eqx.Module):
    """A circular obstacle: centre (x, y) and radius [m]."""

    x: Real
    y: Real
    radius: Real


class Arena(eqx.Module):
    """A rectangle with obstacles in it. How many there are, and of how many corners, is static; the rest is data.

    Attributes:
        x_min, x_max, y_min, y_max: the walls [m].
        discs, polygons: the obstacles.
        map: cells that are obstacles, or None.
        territory: where the evader wins and does not start, or None.
    """

    x_min: Real = 0.0
    x_max: Real = 10.0
    y_min: Real = 0.0
    y_max: Real = 10.0
    discs: tuple[Disc, ...] = ()
    polygons: tuple[Polygon, ...] = ()
    map: OccupancyMap | None = None
    territory: Disc | None = None

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Distance [m] from a point to the nearest wall or obstacle; negative outside the walls or in an obstacle."""
        return functools.reduce(jnp.minimum, [*self._to_each_wall(x, y), *self._to_obstacles(x, y)])

    def clearances(self, x: Scalar, y: Scalar) -> list[Scalar]:
        """Distance [m] from a point to each of the four walls, then to each obstacle; negative on the wrong side."""
        to_polygons = [clearance_from([polygon], x, y) for polygon in self.polygons]
        return [*self._to_each_wall(x, y), *self._to_discs(x, y), *to_polygons, *self._to_map(x, y)]

    @property
    def has_obstacles(self) -> bool:
        """Whether there is anything but walls."""
        return bool(self.discs or self.polygons or self.map)

    def to_obstacles(self, x: Scalar, y: Scalar) -> Scalar:
        """Distance [m] from a point to the nearest obstacle; negative inside it. There must be one."""
        return functools.reduce(jnp.minimum, self._to_obstacles(x, y))

    def _to_each_wall(self, x: Scalar, y: Scalar) -> list[Scalar]:
        return [x - self.x_min, self.x_max - x, y - self.y_min, self.y_max - y]

    def _to_discs(self, x: Scalar, y: Scalar) -> list[Scalar]:
        return [jnp.hypot(x - disc.x, y - disc.y) - disc.radius for disc in self.discs]

    def _to_obstacles(self, x: Scalar, y: Scalar) -> list[Scalar]:
        """Of each disc, of all polygons together, which costs less than of each, and of the map."""
        to_polygons = [clearance_from(self.polygons, x, y)] if self.polygons else []
        return [*self._to_discs(x, y), *to_polygons, *self._to_map(x, y)]

    def _to_map(self, x: Scalar, y: Scalar) -> list[Scalar]:
        return [self.map.clearance(x, y)] if self.map else []

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Least clearance [m] on the segment between two states."""
        least = jnp.minimum(self._to_walls(before.x, before.y), self._to_walls(after.x, after.y))
        dx, dy = after.x - before.x, after.y - before.y
        for disc in self.discs:
            approach = closest_approach_squared(before.x - disc.x, before.y - disc.y, dx, dy)
            least = jnp.minimum(least, jnp.sqrt(approach) - disc.radius)
        return functools.reduce(jnp.minimum, self._to_others_along(before, after), least)

    def _to_others_along(self, before: RobotState, after: RobotState) -> list[Scalar]:
        """Least clearance [m] on the segment between two states from what is no disc."""
        to_polygons = [clearance_along(self.polygons, before, after)] if self.polygons else []
        return [*to_polygons, *([self.map.clearance_along(before, after)] if self.map else [])]

    def _to_walls(self, x: Scalar, y: Scalar) -> Scalar:
        return jnp.minimum(jnp.minimum(x - self.x_min, self.x_max - x), jnp.minimum(y - self.y_min, self.y_max - y))

    def hits_obstacle(self, before: RobotState, after: RobotState, radius: Real) -> Bool[Array, ""]:
        """Whether a body of this radius [m] touches an obstacle anywhere along the segment between two states."""
        dx, dy = after.x - before.x, after.y - before.y
        hit = jnp.zeros((), bool)
        for disc in self.discs:
            approach = closest_approach_squared(before.x - disc.x, before.y - disc.y, dx, dy)
            hit = hit | (approach < (disc.radius + radius) ** 2)
        for clearance in self._to_others_along(before, after):
            hit = hit | (clearance < radius)
        return hit

    def reaches_territory(self, before: RobotState, after: RobotState) -> Bool[Array, ""]:
        """Whether a robot's centre comes into the territory anywhere along the segment between two states."""
        goal = self.territory
        assert goal is not None, "who asks knows that there is one"
        approach = closest_approach_squared(
            before.x - goal.x, before.y - goal.y, after.x - before.x, after.y - before.y
        )
        return approach < goal.radius**2

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
