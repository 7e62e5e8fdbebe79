"""The surroundings of a robot: the arena, by its chart, and the movers in sight."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from apollonius.game.chart import Chart
from apollonius.game.movers import MoverBodies
from apollonius.game.obstacle import closest_approach_squared
from apollonius.game.types import MoverMotion, Real, RobotState, Scalar

FORESIGHT = 1.0
"""Time [s] within which a mover bars the directions that it comes to."""


class MoversInView(eqx.Module):
    """The movers as one robot sees them, leaves `[movers]`. It does not know where they go next.

    Attributes:
        bodies: their shapes and limits.
        motion: their places [m] and velocities [m/s]; those of hidden ones mean nothing.
        in_sight: which of these are not hidden; None for a side that sees everything.
        age: time [s] from now until a command that is given now takes effect.
    """

    bodies: MoverBodies
    motion: MoverMotion
    in_sight: Bool[Array, " movers"] | None
    age: Real

    def clearance_along(
        self, before: RobotState, after: RobotState, time: Real, dt: Real
    ) -> Scalar:
        """Return a lower bound of the distance [m] of a robot's centre, on a step of a manoeuvre,
        from all that movers in sight can reach until then; infinite for a robot that rests, which
        does not fail where it is walked into.

        Args:
            before, after: the robot before and after the step.
            time: from the start of the manoeuvre to that of the step [s].
            dt: duration of the step [s].
        """
        since_seen = self.age + time
        distances = self.bodies.distance_from_reach(self.motion, before, after, since_seen, dt)
        is_at_rest = (before.v == 0) & (after.v == 0)
        return jnp.where(is_at_rest, jnp.inf, self._least(distances))

    def clearance(self, x: Scalar, y: Scalar, time: Real) -> Scalar:
        """Return the distance [m] from a point to the nearest mover in sight if all keep their
        velocities; negative inside, infinite without any in sight.

        Args:
            x, y: the point [m].
            time: from when a command that is given now takes effect [s].
        """
        later = self.age + time
        motion = self.motion
        from_x = x - (motion.x + motion.vx * later)
        from_y = y - (motion.y + motion.vy * later)
        hx, hy = self.bodies.hx, self.bodies.hy
        approach = jax.vmap(closest_approach_squared)
        to_axis = jnp.sqrt(approach(from_x + hx, from_y + hy, -2 * hx, -2 * hy))
        return self._least(to_axis - self.bodies.radius)

    def range(self, x: Scalar, y: Scalar, cos: Scalar, sin: Scalar, radius: Real) -> Scalar:
        """Return the distance [m] that a disc can go in a direction before it comes to where a
        mover in sight is, or will be within `FORESIGHT` at the velocity that it has; infinite if it
        comes to none.

        Of a mover that does not move along its own axis these are its body now, and the path of its
        centre with its radius. Those that the disc touches already do not count.

        Args:
            x, y: the centre of the disc [m].
            cos, sin: cosine and sine of the direction.
            radius: that of the disc [m].
        """
        motion, bodies = self.motion, self.bodies
        start = motion.x - x, motion.y - y
        path = motion.vx * FORESIGHT, motion.vy * FORESIGHT
        tail = start[0] - bodies.hx, start[1] - bodies.hy
        distance = jax.vmap(distance_to_capsule, (0, 0, None, 0))
        room = bodies.radius + radius
        to_body = distance(tail, (2 * bodies.hx, 2 * bodies.hy), (cos, sin), room)
        to_path = distance(start, path, (cos, sin), room)
        return self._least(jnp.minimum(to_body, to_path))

    def _least(self, distances: Float[Array, " movers"]) -> Scalar:
        """Return the least of the distances [m] of movers in sight."""
        if self.in_sight is not None:
            distances = jnp.where(self.in_sight, distances, jnp.inf)
        return jnp.min(distances)


class Surroundings(eqx.Module):
    """An arena's chart, and the movers that a robot sees; None in a game without any."""

    chart: Chart
    movers: MoversInView | None = None

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Return the distance [m] from a point to the nearest wall, obstacle or mover."""
        clearance = self.chart.clearance(x, y)
        if self.movers is None:
            return clearance
        return jnp.minimum(clearance, self.movers.clearance(x, y, 0.0))

    def clearance_from_movers(self, robot: RobotState, time: Real) -> Scalar | float:
        """Return the distance [m] of a robot's centre from the nearest mover, as in
        `MoversInView.clearance`; infinite at rest, where it may be walked into, and without movers.

        Args:
            robot: the robot at that time.
            time: from when a command that is given now takes effect [s].
        """
        if self.movers is None:
            return jnp.inf
        return jnp.where(robot.v == 0, jnp.inf, self.movers.clearance(robot.x, robot.y, time))

    def range(self, x: Scalar, y: Scalar, cos: Scalar, sin: Scalar, radius: Real) -> Scalar:
        """Return the distance [m] that a disc can go in a direction; along long walls, too little.

        Args:
            x, y: the centre of the disc [m].
            cos, sin: cosine and sine of the direction.
            radius: that of the disc [m].
        """
        to_arena = self.chart.range(x, y, cos, sin)
        if self.movers is None:
            return to_arena
        return jnp.minimum(to_arena, self.movers.range(x, y, cos, sin, radius) + radius)


def distance_to_capsule(
    start: tuple[Scalar, Scalar],
    axis: tuple[Scalar, Scalar],
    direction: tuple[Scalar, Scalar],
    radius: Real,
) -> Scalar:
    """Return the distance [m] from the origin to the outline of a capsule in a direction; infinite
    where the direction misses it, and inside.

    Args:
        start: x, y of the start of its axis [m].
        axis: x, y from there to its end [m]; may be 0.
        direction: cosine and sine of the direction.
        radius: of the capsule [m].
    """
    length = jnp.hypot(*axis)
    axis_x, axis_y = (part / jnp.maximum(length, 1e-6) for part in axis)
    # The origin and the direction along the axis and across it, to the left.
    along = -(start[0] * axis_x + start[1] * axis_y)
    across = start[0] * axis_y - start[1] * axis_x
    advance = direction[0] * axis_x + direction[1] * axis_y
    drift = direction[1] * axis_x - direction[0] * axis_y
    to_side = (jnp.sign(across) * radius - across) / jnp.where(drift == 0, 1e-9, drift)
    meets_at = along + to_side * advance
    meets_side = (to_side >= 0) & (meets_at >= 0) & (meets_at < length)
    end = start[0] + axis[0], start[1] + axis[1]
    to_ends = [_distance_to_disc(center, direction, radius) for center in (start, end)]
    least = jnp.minimum(jnp.where(meets_side, to_side, jnp.inf), jnp.minimum(*to_ends))
    is_outside = closest_approach_squared(*start, *axis) > radius**2
    return jnp.where(is_outside, least, jnp.inf)


def _distance_to_disc(
    center: tuple[Scalar, Scalar], direction: tuple[Scalar, Scalar], radius: Real
) -> Scalar:
    """Return the distance [m] from the origin to a disc in a direction; infinite where the
    direction misses it.
    """
    (x, y), (cos, sin) = center, direction
    along, across = x * cos + y * sin, x * sin - y * cos
    half_chord = radius**2 - across**2
    meets = (half_chord >= 0) & (along >= 0)
    return jnp.where(meets, along - jnp.sqrt(jnp.maximum(half_chord, 0.0)), jnp.inf)
