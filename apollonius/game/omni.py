"""A robot on omnidirectional wheels, which drives in every direction without turning its body."""

import jax.numpy as jnp

from apollonius.game.dynamics import Unicycle
from apollonius.game.types import Real, Scalar
from apollonius.io.errors import require

_AT_REST = 1e-6
"""Speed [m/s] below which any course can be taken at once."""


class Omni(Unicycle):
    """A robot on omnidirectional wheels (mecanum or omni wheels), whose `heading` is its course.

    Its body, a disc, keeps any attitude; velocity is what counts. Forces along the course change
    the speed, those across it the course: by at most `lateral_acceleration / |v|`, so that at rest
    every course is open, one turn of u2_max at a time.

    Attributes:
        u2_max: largest rate at which the course turns, either sign [rad/s].
        lateral_acceleration: largest acceleration across the course [m/s^2].
    """

    u2_max: Real = 4.0
    lateral_acceleration: Real = 0.3

    def check(self, name: str, dt: Real) -> None:
        """Refuse impossible limits, and turns too large for a step of `dt` [s]."""
        super().check(name, dt)
        value = self.lateral_acceleration
        require(value > 0, f"{name}.lateral_acceleration", value, "more than 0 m/s^2")

    def turn_rate(self, u2: Scalar, v: Scalar) -> Scalar:
        """Return the rate at which the course turns [rad/s] at a speed [m/s]."""
        limit = self.lateral_acceleration / jnp.maximum(jnp.abs(v), _AT_REST)
        return jnp.clip(u2, -limit, limit)

    def fastest_on_arc(self, radius: Scalar) -> Scalar:
        """Return the highest speed [m/s] at which the robot can drive an arc of a radius [m]."""
        across = jnp.sqrt(jnp.asarray(self.lateral_acceleration, jnp.float32) * radius)
        return jnp.minimum(super().fastest_on_arc(radius), across)
