"""Drives of the robots of a side: how late and how slowly they do what their players ask for.
Without them robots do it at once, as in the paper.
"""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from apollonius.game.dynamics import Unicycle
from apollonius.game.types import (
    Action,
    BySide,
    Controls,
    DriveState,
    DriveStates,
    Real,
    RobotState,
    Role,
    Scalar,
    tree_where,
)
from apollonius.game.uncertainty import Uncertainty
from apollonius.io.errors import require

MOST_LAG = 10
"""Longest lag of commands [steps]."""


class Drive(eqx.Module):
    """The drive of each robot of a side; None stands for no limit.

    Attributes:
        lag: whole steps by which commands are late.
        turn_time: time to change the turn rate by u2_max [s].
    """

    lag: Real | None = None
    turn_time: Real | None = None

    def check(self, name: str) -> None:
        """Refuse impossible numbers."""
        bound = f"a whole number of steps from 0 to {MOST_LAG}, or left out"
        lag, time = self.lag, self.turn_time
        require(
            lag is None or (0 <= lag <= MOST_LAG and lag == int(lag)), f"{name}.lag", lag, bound
        )
        require(time is None or time >= 0, f"{name}.turn_time", time, "0 s or more, or left out")

    def at_rest(self) -> DriveState:
        """Return the drive of a robot at rest."""
        pending = None if self.lag is None else jnp.zeros((MOST_LAG, 2))
        return DriveState(pending, None if self.turn_time is None else jnp.zeros(()))

    def respond(
        self, state: DriveState, body: Unicycle, action: Action, dt: Real
    ) -> tuple[Controls, DriveState]:
        """Return the controls that the robot holds in this step, and its drive after it.

        Args:
            state: pending commands and turn rate before the step.
            body: the robot's limits.
            action: the player's action.
            dt: duration of the step [s].

        Returns u1 [m/s^2] and u2 [rad/s].
        """
        u1, u2 = body.controls(action)
        if self.lag is not None:
            assert state.pending is not None, "the drive began with the same limits"
            commands = jnp.concatenate([jnp.stack([u1, u2])[None], state.pending])
            u1, u2 = commands[jnp.asarray(self.lag).astype(jnp.int32)]
            state = replace(state, pending=commands[:MOST_LAG])
        u2, rate = limited_turn_rate(body, self.turn_time, state.turn_rate, u2, dt)
        return (u1, u2), replace(state, turn_rate=rate)


class PredictedRobot(eqx.Module):
    """A robot when a command of now takes effect.

    Attributes:
        robot: its state.
        turn_rate: its turn rate [rad/s]; None for one that turns at once.
        uncertainty: bounds of its errors; None for a robot that knows itself exactly.
    """

    robot: RobotState
    turn_rate: Scalar | None
    uncertainty: Uncertainty | None = None


def predict_after_lag(
    drive: Drive, state: DriveState, body: Unicycle, now: PredictedRobot, dt: Real
) -> PredictedRobot:
    """Predict a robot when a command of now takes effect.

    Until then it obeys the commands that are on their way.

    Args:
        drive, state: the robot's drive, and its pending commands.
        body: the robot's limits.
        now: the robot as it is.
        dt: duration of a step [s].
    """
    if state.pending is None or drive.lag is None:
        return now
    pending = jnp.asarray(state.pending)
    lag = jnp.asarray(drive.lag).astype(jnp.int32)

    def command(age: Array) -> Controls:
        u1, u2 = pending[jnp.clip(age, 0, MOST_LAG - 1)]
        return u1, u2

    def one_step(before: PredictedRobot, step: Array) -> tuple[PredictedRobot, None]:
        age = lag - 1 - step
        u1, u2 = command(age)
        mean, rate = limited_turn_rate(body, drive.turn_time, before.turn_rate, u2, dt)
        robot = body.move(before.robot, u1, mean, dt)
        uncertainty = before.uncertainty
        if uncertainty is not None:
            uncertainty = uncertainty.after_switch(command(age + 1), (u1, u2))
            uncertainty = uncertainty.after_motion(body, before.robot, robot, (u1, u2), dt)
        after = PredictedRobot(robot, rate, uncertainty)
        return tree_where(step < lag, after, before), None

    return jax.lax.scan(one_step, now, jnp.arange(MOST_LAG))[0]


def limited_turn_rate(
    body: Unicycle, turn_time: Real | None, rate: Scalar | None, commanded: Scalar, dt: Real
) -> tuple[Scalar, Scalar | None]:
    """Return the mean turn rate over a step and the turn rate after it [rad/s].

    The turn rate approaches the commanded one linearly, by u2_max in `turn_time`. Without a turn
    time it equals the command at once, and there is no rate after the step.

    Args:
        body: the robot's limits.
        turn_time: time to change the turn rate by u2_max [s], or None.
        rate: turn rate before the step [rad/s], or None.
        commanded: commanded turn rate [rad/s].
        dt: duration of the step [s].
    """
    if turn_time is None:
        return commanded, None
    assert rate is not None, "a drive with a turn time has a turn rate"
    max_change = body.u2_max * dt / jnp.maximum(turn_time, 1e-6)
    change = jnp.clip(commanded - rate, -max_change, max_change)
    mean = rate + change - change * jnp.abs(change) / jnp.maximum(2 * max_change, 1e-9)
    return mean, rate + change


class Drives(BySide[Drive | None]):
    """The drives of both sides; None for robots that do at once what their players ask for."""

    pursuer: Drive | None = None
    evader: Drive | None = None


def drive_of(drives: Drives | None, role: Role) -> Drive:
    """Return the drive of each robot of a side."""
    return (drives and drives[role]) or Drive()


def respond(
    drive: Drive,
    states: DriveStates,
    bodies: Sequence[Unicycle],
    actions: Sequence[Action],
    dt: Real,
) -> tuple[tuple[Controls, ...], DriveStates]:
    """Return the controls that a side's robots hold in this step, and their drives after it.

    Args:
        drive: the drive of each robot of the side.
        states, bodies, actions: pending commands, limits and action of each robot.
        dt: duration of the step [s].
    """
    responses = [drive.respond(*robot, dt) for robot in zip(states, bodies, actions, strict=True)]
    return tuple(controls for controls, _ in responses), tuple(after for _, after in responses)
