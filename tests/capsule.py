"""A new kind of obstacle: a wall with round ends. Named in `docs/how-to/extend.md`."""

import math

import jax.numpy as jnp

from apollonius.game.obstacle import AbstractObstacle, closest_approach_squared
from apollonius.game.polygon import Edge
from apollonius.game.types import Real
from apollonius.io.errors import require


class Capsule(AbstractObstacle):
    """All places within a radius [m] of the line from (x, y) to (to_x, to_y) [m]."""

    x: Real
    y: Real
    to_x: Real
    to_y: Real
    radius: Real

    def clearance(self, x, y):
        """Distance [m] from a point; negative inside."""
        squared = closest_approach_squared(self.x - x, self.y - y, self.to_x - self.x, self.to_y - self.y)
        return jnp.sqrt(squared) - self.radius

    def clearance_along(self, before, after):
        """Two segments that do not cross are nearest to each other at an end of one of them."""
        step = Capsule(before.x, before.y, after.x, after.y, self.radius)
        ends = [self.clearance(robot.x, robot.y) for robot in (before, after)]
        ends += [step.clearance(x, y) for x, y in ((self.x, self.y), (self.to_x, self.to_y))]
        numbers = self.x, self.y, self.to_x - self.x, self.to_y - self.y
        crossed = Edge(*map(jnp.float32, numbers), jnp.int32(1)).is_crossed(before, after)
        return jnp.where(crossed, -self.radius, jnp.stack(ends).min())

    def outline(self):
        """Half a circle around either end."""
        heading = math.atan2(self.to_y - self.y, self.to_x - self.x)
        turns = [heading + math.pi * (0.5 + step / 8) for step in range(9)]
        return tuple(
            (x + self.radius * math.cos(turn + half), y + self.radius * math.sin(turn + half))
            for x, y, half in ((self.x, self.y, 0.0), (self.to_x, self.to_y, math.pi))
            for turn in turns
        )

    def check(self, name, arena):
        """It has a size, and both ends are inside the walls."""
        require(self.radius > 0, f"{name}.radius", self.radius, "more than 0 m")
        for x, y in ((self.x, self.y), (self.to_x, self.to_y)):
            inside = arena.x_min <= x <= arena.x_max and arena.y_min <= y <= arena.y_max
            require(inside, f"{name} end", (x, y), "inside the walls; move it")
