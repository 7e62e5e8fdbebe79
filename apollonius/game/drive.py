"""Drives that respond late and slowly: from what a player asks for to what its robot does."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.sensing import Sensing
from apollonius.game.types import Action, Real, Role, Scalar
from apollonius.io.errors import require

MOST_LAG = 10
"""Longest lag [steps]."""


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
        require(lag is None or (0 <= lag <= MOST_LAG and lag == int(lag)), f"{name}.lag", lag, bound)
        require(time is None or time >= 0, f"{name}.turn_time", time, "0 s or more, or left out")

    def begin(self) -> "DriveState":
        """Return the drive of a robot at rest."""
        pending = None if self.lag is None else jnp.zeros((MOST_LAG, 2))
        return DriveState(pending, None if self.turn_time is None else jnp.zeros(()))

    def respond(
        self, state: "DriveState", body: Unicycle, action: Action, dt: Real
    ) -> tuple[tuple[Scalar, Scalar], "DriveState"]:
        """Return the controls u1 [m/s^2] and u2 [rad/s] that the robot holds in this step, and the drive after it.

        A turn rate that changes at a constant rate until it is reached turns the robot by its mean over the step.
        """
        u1, u2 = body.controls(action)
        if self.lag is not None:
            assert state.pending is not None, "the drive began with the same limits"
            known = jnp.concatenate([jnp.stack([u1, u2])[None], state.pending])
            u1, u2 = known[jnp.asarray(self.lag).astype(jnp.int32)]
            state = replace(state, pending=known[:MOST_LAG])
        if self.turn_time is not None:
            assert state.turn_rate is not None, "the drive began with the same limits"
            most = body.u2_max * dt / jnp.maximum(self.turn_time, 1e-6)
            made = jnp.clip(u2 - state.turn_rate, -most, most)
            u2 = state.turn_rate + made - made * jnp.abs(made) / (2 * most)
            state = replace(state, turn_rate=state.turn_rate + made)
        return (u1, u2), state


class DriveState(eqx.Module):
    """What of a drive's past still matters.

    Attributes:
        pending: the latest commands, u1 [m/s^2] and u2 [rad/s], the newest first.
        turn_rate: at present [rad/s].
    """

    pending: Float[Array, "*batch lag 2"] | None
    turn_rate: Float[Array, "*batch"] | None


class Drives(BySide[Drive | None]):
    """The drives of both sides; None for robots that do at once what their players ask for."""

    pursuer: Drive | None = None
    evader: Drive | None = None


def check_parts(sensors: Sensing | None, drives: Drives | None) -> None:
    """Refuse impossible numbers of sensors and drives."""
    for name, parts in (("sensors", sensors), ("drives", drives)):
        for side, part in zip(("pursuer", "evader"), parts or (), strict=False):
            if part:
                part.check(f"{name}.{side}")


DriveStates = tuple[DriveState, ...]
"""The drives of the robots of a side."""


def at_rest(drives: Drives | None, role: Role, robots: int) -> DriveStates | None:
    """Return the drives of a side's robots at the start of a game; None where nothing limits them."""
    drive = drives and drives[role]
    return None if drive is None else (drive.begin(),) * robots


def respond(
    drives: Drives | None,
    role: Role,
    states: DriveStates | None,
    bodies: Sequence[Unicycle],
    actions: Sequence[Action],
    dt: Real,
) -> tuple[tuple[tuple[Scalar, Scalar], ...], DriveStates | None]:
    """Return the controls that a side's robots hold in this step, and their drives after it."""
    drive = drives and drives[role]
    if drive is None or states is None:
        return tuple(body.controls(action) for body, action in zip(bodies, actions, strict=True)), None
    made = [drive.respond(*robot, dt) for robot in zip(states, bodies, actions, strict=True)]
    return tuple(controls for controls, _ in made), tuple(after for _, after in made)
