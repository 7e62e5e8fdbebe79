"""Sensors of the robots of a side. Without them robots see everything, exactly and at once, as in
the paper; mates know of each other, and share what they see.
"""

import functools
import operator
from collections.abc import Sequence
from dataclasses import fields

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

from apollonius.accelerate.fusion_barrier import fusion_barrier
from apollonius.game.arena import Arena
from apollonius.game.dynamics import wrap_angle
from apollonius.game.types import (
    BySide,
    Flag,
    GameState,
    RandomBits,
    Real,
    RobotState,
    Role,
    Scalar,
)
from apollonius.game.uncertainty import Uncertainty
from apollonius.io.errors import require

MOST_DELAY = 10
"""Longest delay of what is seen [steps]."""
BOUND = 3.0
"""Standard deviations beyond which there are no errors."""
_OWN = 2
_OPPONENTS = 3
_DROPPED = 4
"""Numbers folded into random bits, beside the player's own use."""


class Noise(eqx.Module):
    """Standard deviations of the errors of seen states: normal, cut at `BOUND` times these, new in
    every step.

    Attributes:
        position: of x and of y [m].
        heading: [rad].
        speed: [m/s].
    """

    position: Real = 0.0
    heading: Real = 0.0
    speed: Real = 0.0

    @property
    def bounds(self) -> Uncertainty:
        """The largest errors."""
        return Uncertainty(
            position=self.reach, heading=self.heading * BOUND, speed=self.speed * BOUND
        )

    @property
    def reach(self) -> Scalar:
        """Return the largest error of a position [m]."""
        return jnp.asarray(self.position, jnp.float32) * BOUND * 2**0.5

    def add_to(
        self, robots: Sequence[RobotState], bits: RandomBits, use: int
    ) -> tuple[RobotState, ...]:
        """Return robots with errors from random bits, folded with the number of their use."""
        key = jax.random.fold_in(jax.random.key(bits), use)
        errors = jnp.clip(jax.random.normal(key, (len(robots), 4)), -BOUND, BOUND)
        return tuple(
            RobotState(
                x=robot.x + self.position * x,
                y=robot.y + self.position * y,
                v=robot.v + self.speed * v,
                heading=wrap_angle(robot.heading + self.heading * heading),
            )
            for robot, (x, y, v, heading) in zip(robots, errors, strict=True)
        )


class Sensors(eqx.Module):
    """The sensors of each robot of a side; None stands for no limit.

    Attributes:
        line_of_sight: whether obstacles hide what is behind them.
        range: largest distance between centres at which an opponent is seen [m]; 0 for blind
            robots.
        field_of_view: angle that they see, half of it on either side of the heading [rad].
        noise: of the opponents that are seen.
        own_noise: of the robots' own states and those of their mates.
        drop_out: probability that in a step nothing is seen.
        delay: age of what is seen, in whole steps; a robot's own state is known at once.
    """

    line_of_sight: bool = eqx.field(static=True, default=False)
    range: Real | None = None
    field_of_view: Real | None = None
    noise: Noise | None = None
    own_noise: Noise | None = None
    drop_out: Real | None = None
    delay: Real | None = None

    def check(self, name: str) -> None:
        """Refuse impossible numbers."""
        bounds = (
            ("range", self.range, 0, float("inf"), "0 m or more"),
            ("field_of_view", self.field_of_view, 0, 7, "from 0 to 6.29 rad, all around"),
            ("drop_out", self.drop_out, 0, 1, "from 0 to 1, a probability"),
            ("delay", self.delay, 0, MOST_DELAY, f"from 0 to {MOST_DELAY} whole steps"),
        )
        for field, value, low, high, bound in bounds:
            require(
                value is None or low <= value <= high,
                f"{name}.{field}",
                value,
                f"{bound}; or left out",
            )
        require(
            self.delay is None or self.delay == int(self.delay),
            f"{name}.delay",
            self.delay,
            "whole steps",
        )
        for noise in ("noise", "own_noise"):
            for error in fields(Noise) if getattr(self, noise) else ():
                size = getattr(getattr(self, noise), error.name)
                require(size >= 0, f"{name}.{noise}.{error.name}", size, "0 or more")

    @property
    def sees_all(self) -> bool:
        """Check whether nothing limits what is in sight."""
        return not self.line_of_sight and self.range is None and self.field_of_view is None

    @fusion_barrier
    def reaches(self, arena: Arena, robot: RobotState, other: RobotState) -> Flag:
        """Check whether a robot has another one's centre in sight."""
        dx, dy = other.x - robot.x, other.y - robot.y
        is_visible = jnp.ones((), bool)
        if self.line_of_sight:
            is_visible &= ~arena.hides(robot, other)
        if self.range is not None:
            is_visible &= jnp.hypot(dx, dy) <= self.range
        if self.field_of_view is not None:
            bearing = wrap_angle(jnp.arctan2(dy, dx) - robot.heading)
            is_visible &= jnp.abs(bearing) <= self.field_of_view / 2
        return is_visible

    def movers_in_sight(
        self, arena: Arena, state: GameState, role: Role
    ) -> Bool[Array, " movers"] | None:
        """Check which movers an active robot of a side has in sight by their centres: at once and
        exactly, without noise, delay and drop-out. None in a game without movers.
        """
        if state.movers is None:
            return None
        observers = list(zip(state.robots[role], state.active[role], strict=True))

        def is_in_sight(x: Scalar, y: Scalar) -> Flag:
            centre = RobotState(x, y, jnp.zeros(()), jnp.zeros(()))
            sightings = [active & self.reaches(arena, robot, centre) for robot, active in observers]
            return functools.reduce(operator.or_, sightings)

        return jax.vmap(is_in_sight)(state.movers.motion.x, state.movers.motion.y)


class Sensing(BySide[Sensors | None]):
    """The sensors of both sides; None for robots that see everything."""

    pursuer: Sensors | None = None
    evader: Sensors | None = None


class Percept(eqx.Module):
    """The states of a side's robots and of its opponents with errors, and which opponents an active
    robot sees.

    States of those that are not seen mean nothing. In a drop-out nothing is seen, and `has_looked`
    is False.
    """

    own: tuple[RobotState, ...]
    opponents: tuple[RobotState, ...]
    in_sight: tuple[Flag, ...]
    has_looked: Flag


def sense(
    sensors: Sensors, arena: Arena, state: GameState, role: Role, bits: RandomBits
) -> Percept:
    """Sense the opponents with the sensors of one side.

    Args:
        sensors: the side's sensors.
        arena: the arena.
        state: the true state.
        role: the side.
        bits: random bits of this side in this step.
    """
    own, opponents = state.robots[role], state.robots[role.other]
    has_looked = jnp.ones((), bool)
    if sensors.drop_out is not None:
        key = jax.random.fold_in(jax.random.key(bits), _DROPPED)
        has_looked = jax.random.uniform(key) >= sensors.drop_out

    def is_seen(other: RobotState, is_active: Flag) -> Flag:
        observers = zip(own, state.active[role], strict=True)
        sightings = [active & sensors.reaches(arena, robot, other) for robot, active in observers]
        return has_looked & is_active & functools.reduce(operator.or_, sightings)

    return Percept(
        own=sensors.own_noise.add_to(own, bits, _OWN) if sensors.own_noise else own,
        opponents=sensors.noise.add_to(opponents, bits, _OPPONENTS) if sensors.noise else opponents,
        in_sight=tuple(map(is_seen, opponents, state.active[role.other])),
        has_looked=has_looked,
    )
