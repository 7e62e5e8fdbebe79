"""Bounds of what a robot does not know of itself, and how they grow while it moves."""

import operator
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp

from apollonius.game.dynamics import Unicycle
from apollonius.game.types import BySide, Controls, Real, RobotState
from apollonius.io.errors import require


class Uncertainty(eqx.Module):
    """Largest differences between what a robot knows of itself and the truth.

    They are promises of the user, which only shields read: the rules draw no errors from them.

    Attributes:
        position: distance of the true place from the known one [m].
        heading: [rad].
        speed: [m/s].
        delay: time by which a command may take effect later than its drive says [s].
        acceleration, turning: shares by which the robot's accelerations and turn rates may be
            larger or smaller than its limits say.
        turn_delay: time by which turn rates may follow later besides [s].
    """

    position: Real = 0.0
    heading: Real = 0.0
    speed: Real = 0.0
    delay: Real = 0.0
    acceleration: Real = 0.0
    turning: Real = 0.0
    turn_delay: Real = 0.0

    def check(self, name: str) -> None:
        """Refuse impossible numbers."""
        for field, unit in (
            ("position", " m"),
            ("heading", " rad"),
            ("speed", " m/s"),
            ("delay", " s"),
            ("acceleration", ""),
            ("turning", ""),
            ("turn_delay", " s"),
        ):
            value = getattr(self, field)
            require(value >= 0, f"{name}.{field}", value, f"0{unit} or more")
        for field in ("acceleration", "turning"):
            value = getattr(self, field)
            require(value < 1, f"{name}.{field}", value, "less than 1, a share of the limit")

    def plus(self, other: "Uncertainty") -> "Uncertainty":
        """Return the bounds where both kinds of errors may occur at once."""
        return jax.tree.map(operator.add, self, other)

    def after_switch(self, before: Controls, after: Controls) -> "Uncertainty":
        """Return the bounds after a change of command, which may take effect late.

        Args:
            before, after: acceleration [m/s^2] and turn rate [rad/s] of both commands.
        """
        (u1, u2), (next_u1, next_u2) = before, after
        turn_delay = self.delay + self.turn_delay
        return replace(
            self,
            heading=self.heading + jnp.abs(next_u2 - u2) * turn_delay,
            speed=self.speed + jnp.abs(next_u1 - u1) * self.delay,
        )

    def after_motion(
        self, body: Unicycle, before: RobotState, after: RobotState, controls: Controls, dt: Real
    ) -> "Uncertainty":
        """Return the bounds after a step from one known state to another.

        The true velocity differs from the known one by at most the error of the speed, and by the
        known speed times the error of the heading. A robot that is known to have come to rest, and
        brakes, may still roll out.

        Args:
            body: the robot's limits.
            before, after: its states before and after the step, as they are known.
            controls: acceleration [m/s^2] and turn rate [rad/s] in the step.
            dt: duration of the step [s].
        """
        u1, _ = controls
        faster = self.speed + self.acceleration * body.u1_max * dt
        rolls_out = jnp.maximum(self.speed - (1 - self.acceleration) * body.u1_max * dt, 0.0)
        is_at_rest = (before.v <= 0) & (after.v <= 0) & (u1 < 0)
        heading = self.heading + self.turning * body.u2_max * dt
        fastest = jnp.maximum(before.v, after.v)
        return replace(
            self,
            position=self.position + dt * (jnp.maximum(self.speed, faster) + fastest * heading),
            heading=heading,
            speed=jnp.where(is_at_rest, rolls_out, faster),
        )


class Uncertainties(BySide[Uncertainty | None]):
    """The uncertainty of the robots of both sides; None for robots that know themselves exactly."""

    pursuer: Uncertainty | None = None
    evader: Uncertainty | None = None
