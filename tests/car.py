"""A new kind of robot: a car, whose steering limits its turn rate. Named in `docs/how-to/extend.md`."""

import math

import jax.numpy as jnp

from apollonius.game.dynamics import Unicycle
from apollonius.game.types import Real
from apollonius.io.errors import require


class Car(Unicycle):
    """A robot that turns by steering: at most by v tan(steer_max) / wheelbase [rad/s], so not at rest.

    Attributes:
        wheelbase: distance between the axles [m]; 0 for a robot that turns on the spot.
        steer_max: largest steering angle [rad].
    """

    wheelbase: Real = 0.0
    steer_max: Real = 0.0

    def move(self, robot, u1, u2, dt):
        """Return the robot after holding its controls; the speed at the start of the step limits the turn."""
        steers, fastest = jnp.asarray(self.wheelbase) > 0, jnp.abs(robot.v) * jnp.tan(self.steer_max)
        limit = jnp.where(steers, fastest / jnp.where(steers, self.wheelbase, 1.0), jnp.inf)
        return super().move(robot, u1, jnp.clip(u2, -limit, limit), dt)

    def check(self, name, dt):
        """Refuse a negative wheelbase, and wheels that would stand across."""
        super().check(name, dt)
        require(self.wheelbase >= 0, f"{name}.wheelbase", self.wheelbase, "0 m (no steering limit) or more")
        require(0 <= self.steer_max < math.pi / 2, f"{name}.steer_max", self.steer_max, "from 0 to less than pi / 2")
