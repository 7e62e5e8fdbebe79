"""The clearance that each action leaves a robot which then brakes, read from the arena's chart."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.game.chart import Chart
from apollonius.game.drive import turning
from apollonius.game.types import NUM_ACTIONS, Action, Real, RobotState, Scalar
from apollonius.observe.view import Robot

LEAST_HOLD = 0.1
"""Least time [s] for which an action is taken to be held. Agents weigh clearance against decisions for as long: what a
shorter step takes of it would look small beside what it gains, step after step."""
_POINTS = 12
"""Places, equally far apart, at which the clearance of a path to rest is looked up."""
_LEAST_BRAKING = 0.05
"""Deceleration of a robot that cannot brake as hard as this [m/s^2], on the scale of the paper's robots."""
_SHARPEST = 3.0
"""Largest turn from one place to the next [rad]."""


Way = tuple[RobotState, Scalar | None, Scalar, Scalar]
"""A robot on its way to rest, its turn rate [rad/s] if it has one, its clearance there and the least so far [m]."""


def clearances_after(chart: Chart, robot: Robot, dt: Real) -> Float[Array, "9"]:
    """Return the clearance [m] of a robot's body from when each action takes effect: it is held for a step of `dt` [s],
    but for `LEAST_HOLD` at least, and then the robot brakes to rest while it turns right, drives straight or turns
    left, whichever keeps the most clearance.

    These are the manoeuvres of `apollonius.agents.shield`, by the chart instead of the rules' exact contact, and by the
    robot's drive as far as that is known.
    """
    body, turns = robot.body, jnp.array([-1.0, 0.0, 1.0])
    slower = jnp.sqrt(1 - jnp.arange(_POINTS + 1, dtype=jnp.float32) / _POINTS)
    shares = slower[:-1] - slower[1:]
    braking, hold = jnp.maximum(body.u1_max, _LEAST_BRAKING), jnp.maximum(dt, LEAST_HOLD)

    def after(action: Action) -> Scalar:
        u1, u2 = body.controls(action)
        mean, rate = turning(body, robot.turn_time, robot.turn_rate, u2, hold)
        held = body.move(robot.state_on_command, u1, mean, hold)
        here = chart.clearance(held.x, held.y)
        return jnp.max(jax.vmap(lambda turn: to_rest((held, rate, here, here), turn))(turns)) - body.radius

    def to_rest(begun: Way, turn: Scalar) -> Scalar:
        durations = shares * jnp.maximum(begun[0].v, 0.0) / braking

        def on(before: Way, duration: Scalar) -> tuple[Way, None]:
            state, rate, clearance, least = before
            asked = turn * jnp.minimum(body.u2_max, _SHARPEST / jnp.maximum(duration, 1e-3))
            mean, rate = turning(body, robot.turn_time, rate, asked, duration)
            end = body.move(state, -braking, mean, duration)
            there, length = chart.clearance(end.x, end.y), jnp.hypot(end.x - state.x, end.y - state.y)
            return (end, rate, there, jnp.minimum(least, _between(clearance, there, length))), None

        (_, _, _, least), _ = jax.lax.scan(on, begun, durations)
        return least

    return jax.vmap(after)(jnp.arange(NUM_ACTIONS))


def _between(start: Scalar, end: Scalar, length: Scalar) -> Scalar:
    """Return the clearance [m] on a segment from that at its ends, as if one point were nearest to both."""
    along = (start**2 - end**2 + length**2) / jnp.maximum(2 * length, 1e-6)
    passes = (along > 0) & (along < length)
    height = jnp.sqrt(jnp.maximum(start**2 - along**2, 0.0))
    return jnp.where(passes, jnp.minimum(height, jnp.minimum(start, end)), jnp.minimum(start, end))
