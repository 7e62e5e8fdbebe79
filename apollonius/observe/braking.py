"""The clearance that each action leaves a robot which then brakes, by the arena's chart and the
movers that it sees.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.game.drive import limited_turn_rate
from apollonius.game.types import NUM_ACTIONS, Action, Real, RobotState, Scalar
from apollonius.observe.surroundings import Surroundings
from apollonius.observe.view import Robot

LEAST_HOLD = 0.1
"""Least time [s] for which an action is taken to be held. Agents weigh clearance against decisions
for as long: what a shorter step takes of it would look small beside what it gains, step after step.
"""
_POINTS = 12
"""Places, equally far apart, at which the clearance of a path to rest is looked up."""
_LEAST_BRAKING = 0.05
"""Deceleration of a robot that cannot brake as hard as this [m/s^2], on the scale of the paper's
robots.
"""
_SHARPEST = 3.0
"""Largest turn from one place to the next [rad]."""


class _Braking(NamedTuple):
    """A robot that brakes: its state, turn rate [rad/s] if it has one, clearance from the arena,
    and the least clearance from arena and movers so far.

    Clearances are of the robot's centre [m].
    """

    state: RobotState
    turn_rate: Scalar | None
    clearance: Scalar
    least: Scalar


def clearances_after(surroundings: Surroundings, robot: Robot, dt: Real) -> Float[Array, "9"]:
    """Return the clearance [m] that each action leaves a robot's body which then brakes to rest.

    The action is held for a step of `dt` [s], or for `LEAST_HOLD` if that is longer. Then the robot
    brakes while it turns right, drives straight or turns left, whichever keeps the most clearance.
    Movers keep their velocities, and do not count where the robot is at rest.

    These are the manoeuvres of `apollonius.agents.wrappers.backup`, by the chart instead of the
    rules' exact contact, and by the robot's drive as far as that is known.
    """
    chart, body = surroundings.chart, robot.body
    turns = jnp.array([-1.0, 0.0, 1.0])
    slower = jnp.sqrt(1 - jnp.arange(_POINTS + 1, dtype=jnp.float32) / _POINTS)
    shares = slower[:-1] - slower[1:]
    braking, hold = jnp.maximum(body.u1_max, _LEAST_BRAKING), jnp.maximum(dt, LEAST_HOLD)

    def best_clearance(action: Action) -> Scalar:
        u1, u2 = body.controls(action)
        mean, rate = limited_turn_rate(body, robot.turn_time, robot.turn_rate, u2, hold)
        end_of_hold = body.move(robot.predicted, u1, mean, hold)
        clearance = chart.clearance(end_of_hold.x, end_of_hold.y)
        start = _Braking(end_of_hold, rate, clearance, clearance)
        least = jax.vmap(lambda turn: least_clearance(start, turn))(turns)
        return jnp.max(least) - body.radius

    def least_clearance(start: _Braking, turn: Scalar) -> Scalar:
        # A robot that drives backwards brakes by speeding up.
        time_to_rest = jnp.abs(start.state.v) / braking
        durations = shares * time_to_rest
        starts = hold + (1 - slower[:-1]) * time_to_rest
        deceleration = jnp.where(start.state.v < 0, braking, -braking)

        def one_stretch(before: _Braking, stretch: tuple[Scalar, Scalar]) -> tuple[_Braking, None]:
            duration, time = stretch
            to_movers = surroundings.clearance_from_movers(before.state, time)
            command = turn * jnp.minimum(body.u2_max, _SHARPEST / jnp.maximum(duration, 1e-3))
            mean, rate = limited_turn_rate(
                body, robot.turn_time, before.turn_rate, command, duration
            )
            state = body.move(before.state, deceleration, mean, duration)
            clearance = chart.clearance(state.x, state.y)
            length = jnp.hypot(state.x - before.state.x, state.y - before.state.y)
            to_arena = _between(before.clearance, clearance, length)
            least = jnp.minimum(before.least, jnp.minimum(to_arena, to_movers))
            return _Braking(state, rate, clearance, least), None

        end, _ = jax.lax.scan(one_stretch, start, (durations, starts))
        return end.least

    return jax.vmap(best_clearance)(jnp.arange(NUM_ACTIONS))


def _between(start: Scalar, end: Scalar, length: Scalar) -> Scalar:
    """Return the clearance [m] on a segment from that at its ends, as if one point were nearest to
    both.
    """
    along = (start**2 - end**2 + length**2) / jnp.maximum(2 * length, 1e-6)
    passes = (along > 0) & (along < length)
    height = jnp.sqrt(jnp.maximum(start**2 - along**2, 0.0))
    return jnp.where(passes, jnp.minimum(height, jnp.minimum(start, end)), jnp.minimum(start, end))
