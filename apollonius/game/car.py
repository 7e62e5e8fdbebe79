"""A car: its steering angle sets how sharply it turns, and at rest it does not turn at all."""

import math
from typing import ClassVar

import jax.numpy as jnp

from apollonius.game.dynamics import MAX_TURN, Unicycle, unit_vector
from apollonius.game.types import Real, Scalar
from apollonius.io.errors import require


class Car(Unicycle):
    """A car by the kinematic bicycle model, its place the middle of its rear axle.

    The control u2 is the steering angle of the front wheels [rad]. Under a constant one the car
    drives on a circle of radius `wheelbase / tan(u2)`, whatever its speed, so that a step's turn is
    exact even while the speed changes (Rajamani, "Vehicle Dynamics and Control", 2012, section
    2.2). A drive's `turn_time` is the time in which it steers from straight ahead to u2_max.

    Attributes:
        v_min, v_max: speed limits [m/s]; a car that does not drive backwards cannot leave every
            place.
        u1_max: largest acceleration, either sign [m/s^2].
        u2_max: largest steering angle, either side [rad].
        radius: radius of a disc about the middle of the rear axle that holds the car [m].
        wheelbase: distance between the axles [m].
    """

    v_min: Real = -0.6
    v_max: Real = 1.2
    u1_max: Real = 0.3
    u2_max: Real = 0.42
    radius: Real = 0.0
    wheelbase: Real = 0.33

    second_control: ClassVar[str] = "steering angle u2 [rad]"

    def check(self, name: str, dt: Real) -> None:
        """Refuse impossible limits, and turns too large for a step of `dt` [s]."""
        super().check(name, dt)
        require(self.wheelbase > 0, f"{name}.wheelbase", self.wheelbase, "more than 0 m")
        bound = "from 0 to less than pi / 2 rad: u2 is a car's steering angle"
        require(0 <= self.u2_max < math.pi / 2, f"{name}.u2_max", self.u2_max, bound)
        turn = self.top_speed * dt * math.tan(self.u2_max) / self.wheelbase
        smaller = "make u2_max or dt smaller, or wheelbase larger"
        bound = f"such that a step turns by at most {MAX_TURN} rad, not {turn:.3g}; {smaller}"
        require(turn <= MAX_TURN, f"{name}.u2_max", self.u2_max, bound)

    @property
    def turns_on_the_spot(self) -> bool:
        """Check whether it turns at rest."""
        return False

    @property
    def turning_radius(self) -> Scalar:
        """The radius of its sharpest turn [m]."""
        return 1 / self.curvature(jnp.asarray(self.u2_max, jnp.float32))

    def curvature(self, u2: Scalar) -> Scalar:
        """Return the curvature of the path under a steering angle [1/m]."""
        cos, sin = unit_vector(u2)
        return sin / (cos * self.wheelbase)

    def turn_rate(self, u2: Scalar, v: Scalar) -> Scalar:
        """Return the turn rate [rad/s] under a steering angle at a speed [m/s]."""
        return v * self.curvature(u2)

    def turn(self, u2: Scalar, fastest: Scalar, distance: Scalar, dt: Real) -> Scalar:
        """Return the turn in a step [rad]; the arguments are those of `Unicycle.turn`."""
        del fastest, dt
        return distance * self.curvature(u2)

    def fastest_on_arc(self, radius: Scalar) -> Scalar:
        """Return the top speed [m/s], on arcs that are too sharp, too: going slower does not make
        the car turn more sharply.
        """
        return jnp.full_like(radius, self.v_max)
