"""A robot's motion: a unicycle driven by acceleration and turn rate, within limits (Eq. 1).

Robots of other kinds are unicycles too, whose turn rates depend on their speeds: a car
(`apollonius.game.car`), wheels (`apollonius.game.wheels`), omnidirectional wheels
(`apollonius.game.omni`).
"""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Shaped

from apollonius.game.types import NUM_ACTIONS, Action, Controls, Flag, Real, RobotState, Scalar
from apollonius.io.errors import require

MAX_TURN = 2.0
"""Largest turn in one step [rad]: a step is one arc, and beyond this its contacts would not be
those of its chord.
"""


def wrap_angle(angle: Scalar) -> Scalar:
    """Wrap an angle [rad] to (-pi, pi]."""
    return angle - 2 * jnp.pi * jnp.ceil((angle - jnp.pi) / (2 * jnp.pi))


def unit_vector(angle: Scalar) -> tuple[Scalar, Scalar]:
    """Return cosine and sine of an angle [rad], to 1e-6.

    The series of the half angle, which is within a quarter turn, and the double-angle formulas:
    several times faster than `jnp.cos` and `jnp.sin`, which reduce arguments of any size, and most
    of what a step of the game costs.
    """
    half = wrap_angle(angle) / 2
    square = half * half
    sine_series = -1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800
    cosine_series = -1 / 2, 1 / 24, -1 / 720, 1 / 40320, -1 / 3628800, 1 / 479001600
    sine = half * (1 + square * _horner(square, *sine_series))
    cosine = 1 + square * _horner(square, *cosine_series)
    return 1 - 2 * sine * sine, 2 * sine * cosine


def sinc(angle: Scalar) -> Scalar:
    """Return `sin(angle) / angle` by its series: to 3e-6 within 1 rad, exactly within 0.6 rad."""
    return _horner(angle * angle, 1.0, -1 / 6, 1 / 120, -1 / 5040)


def _horner(x: Scalar, *coefficients: float) -> Scalar:
    """Evaluate the polynomial with these coefficients, the constant one first."""
    value = jnp.full_like(x, coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        value = value * x + coefficient
    return value


MIRRORED = tuple(3 * (action // 3) + 2 - action % 3 for action in range(NUM_ACTIONS))
"""The discrete actions with right and left exchanged."""


def action_levels(action: Action) -> tuple[Scalar, Scalar]:
    """Return the shares of u1_max and u2_max: -1, 0 or 1 each for a discrete action; others are
    clipped to [-1, 1].
    """
    if is_continuous(action):
        share_u1, share_u2 = jnp.clip(action, -1.0, 1.0)
        return share_u1, share_u2
    return (action // 3 - 1).astype(jnp.float32), (action % 3 - 1).astype(jnp.float32)


def as_action(action: Any) -> Action:
    """Return an action, which may be a plain number; raises InvalidInput for anything else."""
    if isinstance(action, int | np.integer):
        require(0 <= action < NUM_ACTIONS, "action", action, f"from 0 to {NUM_ACTIONS - 1}")
    bound = f"a whole number from 0 to {NUM_ACTIONS - 1}, or two real ones from -1 to 1"
    try:
        array = jnp.asarray(action)
    except (TypeError, ValueError):  # of text, of None
        require(False, "action", action, bound)
        raise
    shape = (2,) if is_continuous(array) else ()
    require(array.shape == shape and array.dtype != bool, "action", action, bound)
    return array


def is_continuous(action: Shaped[Array, "..."] | jax.ShapeDtypeStruct) -> bool:
    """Check whether actions, or their shape and type, are pairs of shares; known before anything
    runs.
    """
    return jnp.issubdtype(action.dtype, jnp.floating)


def stack_actions(*actions: Action) -> Int[Array, " robots"] | Float[Array, "robots 2"]:
    """Return the actions of several robots as one array: of shares, where one is continuous."""
    if any(is_continuous(action) for action in actions):
        return jnp.stack([jnp.stack(action_levels(action)) for action in actions])
    return jnp.stack(actions)


class Unicycle(eqx.Module):
    """One robot's body and limits; a `Game` refuses impossible ones.

    Attributes:
        v_min, v_max: speed limits [m/s]; with v_min below 0 the robot drives backwards, too.
        u1_max: largest linear acceleration, either sign [m/s^2].
        u2_max: largest turn rate, either sign [rad/s].
        radius: radius of the robot's disc-shaped body [m]; 0 is a point.
    """

    v_min: Real = 0.0
    v_max: Real = 1.2
    u1_max: Real = 0.3
    u2_max: Real = 0.8
    radius: Real = 0.0

    second_control: ClassVar[str] = "turn rate u2 [rad/s]"
    """What u2 is."""

    @property
    def brakes_to_rest(self) -> bool:
        """Check whether full braking ends at rest rather than in driving on."""
        return bool(self.v_min <= 0 and self.u1_max > 0)

    @property
    def turns_on_the_spot(self) -> Flag | bool:
        """Check whether it turns at rest."""
        return True

    @property
    def turning_radius(self) -> Real:
        """The radius of its sharpest turn [m]."""
        return 0.0

    @property
    def top_speed(self) -> Real:
        """The highest speed, forwards or backwards [m/s]; of limits in plain numbers."""
        return max(self.v_max, -self.v_min)

    @property
    def usual_turn_rate(self) -> Scalar:
        """The largest turn rate at half the top speed [rad/s]."""
        half = jnp.asarray(self.v_max, jnp.float32) / 2
        return self.turn_rate(jnp.asarray(self.u2_max, jnp.float32), half)

    def check(self, name: str, dt: Real) -> None:
        """Refuse impossible limits, and turns too large for a step of `dt` [s]."""
        fastest = f"at most v_max = {self.v_max} m/s; exchange the two"
        largest = f"at most {MAX_TURN / dt:g} rad/s, {MAX_TURN} rad in a step of {dt:g} s"
        for field, holds, bound in (
            ("v_min", self.v_min <= self.v_max, fastest),
            ("v_max", self.v_max > 0, "more than 0 m/s, or the robot cannot go forward"),
            ("u1_max", self.u1_max >= 0, "0 m/s^2 or more; accelerations are -u1_max, 0, +u1_max"),
            ("u2_max", self.u2_max >= 0, "0 rad/s or more; turn rates are -u2_max, 0, +u2_max"),
            ("u2_max", self.u2_max * dt <= MAX_TURN, f"{largest}; make it or dt smaller"),
            ("radius", self.radius >= 0, "0 m (a point) or more"),
        ):
            require(holds, f"{name}.{field}", getattr(self, field), bound)

    def controls(self, action: Action) -> Controls:
        """Return an action's acceleration u1 [m/s^2] and turn rate u2 [rad/s] (Eq. 4, 5)."""
        level_u1, level_u2 = action_levels(action)
        return level_u1 * self.u1_max, level_u2 * self.u2_max

    def braking_level(self, v: Scalar) -> Scalar:
        """Return the share of u1_max that brakes at a speed [m/s].

        A robot that may drive backwards brakes by speeding up then, and not at rest, nor at an
        unknown speed, a NaN.
        """
        level = jnp.where(jnp.asarray(self.v_min < 0), -jnp.sign(v), -1.0)
        return jnp.where(jnp.isnan(level), 0.0, level)

    def turn_rate(self, u2: Scalar, v: Scalar) -> Scalar:
        """Return the turn rate [rad/s] under a control u2 at a speed [m/s]."""
        del v
        return u2

    def turn(self, u2: Scalar, fastest: Scalar, distance: Scalar, dt: Real) -> Scalar:
        """Return the turn in a step [rad], the same at every moment or at every place of it.

        Args:
            u2: the second control.
            fastest: the larger of the speeds before and after the step, without their sign [m/s].
            distance: length of the path in the step, negative backwards [m].
            dt: duration of the step [s].
        """
        del distance
        return self.turn_rate(u2, fastest) * dt

    def fastest_on_arc(self, radius: Scalar) -> Scalar:
        """Return the highest speed [m/s] at which the robot can drive an arc of a radius [m]."""
        return jnp.minimum(self.v_max, self.u2_max * radius)

    def move(self, robot: RobotState, u1: Scalar, u2: Scalar, dt: Real) -> RobotState:
        """Return the robot after holding its controls for a step (Eq. 1).

        The speed is a ramp clipped to its limits and the heading turns at a constant rate; both are
        exact. A robot that brakes comes to rest before it drives the other way, in the next step.
        The robot follows the circular arc of its turn with the ramp's exact mean speed;
        the chord is `mean_v * dt * sinc(turn / 2)` along the middle heading. That is exact
        whenever the speed is constant or the robot does not turn, and of second order in `dt`
        otherwise (2e-5 m in one step of the `paper` game).

        Args:
            robot: its state before.
            u1: acceleration [m/s^2].
            u2: turn rate [rad/s], or the second control of another kind of robot.
            dt: duration of the step [s].
        """
        dv = u1 * dt
        slowest = jnp.where(robot.v > 0, jnp.maximum(self.v_min, 0.0), self.v_min)
        # A speed below v_min = 0 is an error of a sensor.
        reverses = (robot.v < 0) & jnp.asarray(self.v_min < 0)
        fastest = jnp.where(reverses, jnp.minimum(self.v_max, 0.0), self.v_max)
        v = jnp.clip(robot.v + dv, slowest, fastest)
        loss_at_limit = jnp.where(
            dv == 0, 0.0, (v - robot.v) ** 2 / (2 * jnp.where(dv == 0, 1.0, dv))
        )
        mean_v = v - loss_at_limit
        distance = mean_v * dt
        top_speed = jnp.maximum(jnp.abs(robot.v), jnp.abs(v))
        half_turn = self.turn(u2, top_speed, distance, dt) / 2
        chord = distance * sinc(half_turn)
        cos, sin = unit_vector(robot.heading + half_turn)
        return RobotState(
            x=robot.x + chord * cos,
            y=robot.y + chord * sin,
            v=v,
            heading=wrap_angle(robot.heading + 2 * half_turn),
        )
