"""A differential drive whose limits are those of its two wheels."""

import jax.numpy as jnp

from apollonius.game.dynamics import Unicycle
from apollonius.game.types import Real, Scalar
from apollonius.io.errors import require


class Wheels(Unicycle):
    """A robot on two driven wheels, neither of which turns faster than it can.

    The wheels go `v - u2 track / 2` and `v + u2 track / 2`, so the faster the robot drives the less
    it can turn: the turn rate is clipped to `2 (wheel_speed - |v|) / track`. A wheel's acceleration
    is at most `u1_max + track / 2 * u2_max / turn_time`, of a drive with that `turn_time`; these
    two share what the motors can do.

    Attributes:
        track: distance between the wheels [m].
        wheel_speed: largest speed of a wheel's rim, forwards and backwards [m/s]; the robot's
            limits are up to that.
    """

    track: Real = 0.4
    wheel_speed: Real = 1.2

    def check(self, name: str, dt: Real) -> None:
        """Refuse impossible limits, and turns too large for a step of `dt` [s]."""
        super().check(name, dt)
        require(self.track > 0, f"{name}.track", self.track, "more than 0 m")
        for field in ("v_min", "v_max"):
            speed = getattr(self, field)
            bound = f"at most wheel_speed = {self.wheel_speed} m/s in size"
            require(abs(speed) <= self.wheel_speed, f"{name}.{field}", speed, bound)

    def turn_rate(self, u2: Scalar, v: Scalar) -> Scalar:
        """Return the turn rate [rad/s] that the wheels leave at a speed [m/s]."""
        limit = 2 * jnp.maximum(self.wheel_speed - jnp.abs(v), 0.0) / self.track
        return jnp.clip(u2, -limit, limit)

    def fastest_on_arc(self, radius: Scalar) -> Scalar:
        """Return the highest speed [m/s] at which the robot can drive an arc of a radius [m]: the
        outer wheel is at its limit.
        """
        outer = self.wheel_speed * radius / (radius + jnp.asarray(self.track, jnp.float32) / 2)
        return jnp.minimum(super().fastest_on_arc(radius), outer)
