"""Players that chase by a law of guidance: pure pursuit, constant bearing."""

import jax.numpy as jnp

from apollonius.agents.classical import AbstractSteering, direction, separation
from apollonius.game.dynamics import Unicycle, wrap_angle
from apollonius.game.types import RobotState, Scalar
from apollonius.observe.view import View


class PurePursuit(AbstractSteering):
    """Heads for where the opponent is (Bouguer's curve of pursuit, 1732), as fast as the way there can be driven.

    The way there is the arc of Coulter, "Implementation of the Pure Pursuit Path Tracking Algorithm" (1992).
    """

    def course(self, seen: View) -> tuple[Scalar, Scalar]:
        own, opponent = seen.own.state, seen.opponent.state
        return direction(own, opponent), arc_speed(seen.own.body, own, opponent)


class Intercept(AbstractSteering):
    """Heads for where both could be at the same time, if the opponent kept its velocity: constant bearing.

    That is the point where the opponent's course meets the circle of Apollonius, the places that both reach at the
    same time (Isaacs, "Differential Games", 1965): there the pursuer, at its top speed, keeps abreast of the
    opponent's motion across the line of sight. An opponent that crosses faster than that is led by a right angle.
    """

    def course(self, seen: View) -> tuple[Scalar, Scalar]:
        body, own, opponent = seen.own.body, seen.own.state, seen.opponent.state
        sight = direction(own, opponent)
        across = opponent.v * jnp.sin(opponent.heading - sight)
        lead = jnp.arcsin(jnp.clip(across / body.v_max, -1.0, 1.0))
        return sight + lead, arc_speed(body, own, opponent)


def arc_speed(body: Unicycle, robot: RobotState, target: RobotState) -> Scalar:
    """Return the highest speed [m/s] at which a robot can drive the arc from where it is, and heads, to a target.

    The arc has the radius `distance / (2 sin(angle off the heading))`, and what is behind takes half the distance: a
    robot faster than that runs around its target for ever.
    """
    angle = jnp.abs(wrap_angle(direction(robot, target) - robot.heading))
    sine = jnp.sin(jnp.minimum(angle, jnp.pi / 2))
    return jnp.minimum(body.v_max, body.u2_max * separation(robot, target) / jnp.maximum(2 * sine, 1e-6))
