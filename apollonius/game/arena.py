"""Where the robots are: walls (Eq. 2), obstacles, and whether a step along a segment touches them."""

import functools
from dataclasses import fields

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool

from apollonius.game.chart import Chart
from apollonius.game.obstacle import AbstractObstacle, closest_approach_squared
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.polygon import Polygon, Polygons
from apollonius.game.types import Real, RobotState, Scalar
from apollonius.io.errors import require


class Disc(AbstractObstacle):
    """A circular obstacle: centre (x, y) and radius [m]."""

    x: Real
    y: Real
    radius: Real

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Distance [m] from a point; negative inside."""
        return jnp.hypot(x - self.x, y - self.y) - self.radius

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Least clearance [m] on the segment between two states."""
        return jnp.sqrt(self._approach(before, after)) - self.radius

    def is_hit(self, before: RobotState, after: RobotState, radius: Real) -> Bool[Array, ""]:
        """Whether a body of this radius [m] touches it anywhere along the segment between two states."""
        return self._approach(before, after) < (self.radius + radius) ** 2

    def _approach(self, before: RobotState, after: RobotState) -> Scalar:
        dx, dy = after.x - before.x, after.y - before.y
        return closest_approach_squared(before.x - self.x, before.y - self.y, dx, dy)

    def check(self, name: str, arena: "Arena") -> None:
        """Refuse one without a size, and one whose centre is outside the walls."""
        require(self.radius > 0, f"{name}.radius", self.radius, "more than 0 m; remove the disc to have none")
        inside = arena.x_min <= self.x <= arena.x_max and arena.y_min <= self.y <= arena.y_max
        walls = f"[{arena.x_min}, {arena.x_max}] x [{arena.y_min}, {arena.y_max}] m"
        require(inside, f"{name} centre", (self.x, self.y), f"inside the walls {walls}; move or remove the disc")


class Arena(eqx.Module):
    """A rectangle with obstacles in it. How many there are, and of how many corners, is static; the rest is data.

    A field is a kind of obstacle (`apollonius.game.obstacle`): another kind is a file of its own, and a field here.

    Attributes:
        x_min, x_max, y_min, y_max: the walls [m].
        discs, polygons: the obstacles.
        map: cells that are obstacles, or None.
        territory: where the evader wins and does not start, or None.
        chart: what players read who know any arena (`apollonius.arenas.charting`), or None. No file says it.
    """

    x_min: Real = 0.0
    x_max: Real = 10.0
    y_min: Real = 0.0
    y_max: Real = 10.0
    discs: tuple[Disc, ...] = ()
    polygons: tuple[Polygon, ...] = ()
    map: OccupancyMap | None = None
    territory: Disc | None = None
    chart: Chart | None = None

    @property
    def obstacles(self) -> tuple[AbstractObstacle, ...]:
        """All of them: discs, polygons, the map, and those of any other field."""
        values = [getattr(self, field.name) for field in fields(self) if field.name not in ("territory", "chart")]
        several = [one for value in values for one in (value if isinstance(value, tuple) else (value,))]
        return tuple(one for one in several if isinstance(one, AbstractObstacle))

    @property
    def _together(self) -> list[AbstractObstacle]:
        """The same, with all polygons as one: that costs less than each of them."""
        others: list[AbstractObstacle] = [one for one in self.obstacles if not isinstance(one, Polygon)]
        return [*others, Polygons(self.polygons)] if self.polygons else others

    def require_only(self, kinds: tuple[type[AbstractObstacle], ...], bound: str) -> None:
        """Refuse other kinds of obstacles than these: for who knows no others.

        Raises:
            InvalidInput: names those, and what must be.
        """
        others = sorted({type(one).__name__ for one in self.obstacles if not isinstance(one, kinds)})
        require(not others, "obstacles", ", ".join(others), bound)

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Distance [m] from a point to the nearest wall or obstacle; negative outside the walls or in an obstacle."""
        to_obstacles = [one.clearance(x, y) for one in self._together]
        return functools.reduce(jnp.minimum, [*self._to_each_wall(x, y), *to_obstacles])

    def clearances(self, x: Scalar, y: Scalar) -> list[Scalar]:
        """Distance [m] from a point to each of the four walls, then to each obstacle; negative on the wrong side."""
        return [*self._to_each_wall(x, y), *(one.clearance(x, y) for one in self.obstacles)]

    def to_obstacles(self, x: Scalar, y: Scalar) -> Scalar:
        """Distance [m] from a point to the nearest obstacle; negative inside it. There must be one."""
        return functools.reduce(jnp.minimum, [one.clearance(x, y) for one in self._together])

    def _to_each_wall(self, x: Scalar, y: Scalar) -> list[Scalar]:
        return [x - self.x_min, self.x_max - x, y - self.y_min, self.y_max - y]

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Least clearance [m] on the segment between two states."""
        least = jnp.minimum(self._to_walls(before.x, before.y), self._to_walls(after.x, after.y))
        return functools.reduce(jnp.minimum, [one.clearance_along(before, after) for one in self._together], least)

    def _to_walls(self, x: Scalar, y: Scalar) -> Scalar:
        return jnp.minimum(jnp.minimum(x - self.x_min, self.x_max - x), jnp.minimum(y - self.y_min, self.y_max - y))

    def hits_obstacle(self, before: RobotState, after: RobotState, radius: Real) -> Bool[Array, ""]:
        """Whether a body of this radius [m] touches an obstacle anywhere along the segment between two states."""
        hits = [one.is_hit(before, after, radius) for one in self._together]
        return functools.reduce(jnp.logical_or, hits, jnp.zeros((), bool))

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
