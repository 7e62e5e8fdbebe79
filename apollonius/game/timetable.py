"""Movers by the clock: shuttles that go back and forth, and doors that slide open and shut."""

from abc import abstractmethod
from itertools import pairwise
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from apollonius.game.obstacle import Corners, Walls
from apollonius.game.types import Real, Scalar
from apollonius.io.errors import require

MOST_WAYPOINTS = 20
"""Most waypoints of a shuttle: every step looks at all legs between them."""


class Leg(NamedTuple):
    """A straight move from rest to rest: when it starts [s], and where it leads from there [m]."""

    start: Scalar
    dx: Scalar
    dy: Scalar

    @property
    def length(self) -> Scalar:
        """Its length [m]."""
        return jnp.hypot(self.dx, self.dy)


class AbstractTimed(eqx.Module):
    """A capsule whose place is a function of a clock that starts again after each period.

    It covers each leg at its largest acceleration, at most at its top speed, and brakes in time.
    Its fields are explained where it is defined.
    """

    radius: eqx.AbstractVar[Real]
    v_max: eqx.AbstractVar[Real]
    a_max: eqx.AbstractVar[Real]
    hx: eqx.AbstractVar[Real]
    hy: eqx.AbstractVar[Real]
    period: eqx.AbstractVar[Real]

    @property
    @abstractmethod
    def origin(self) -> tuple[Real, Real]:
        """Its place x, y [m] before the first leg."""

    @property
    @abstractmethod
    def legs(self) -> list[Leg]:
        """Its moves in one period, which lead back to where it started."""

    def place(self, clock: Scalar) -> tuple[Scalar, Scalar]:
        """Return its place x, y [m] at a time [s] of its clock."""
        x, y = (jnp.asarray(end, jnp.float32) for end in self.origin)
        for leg in self.legs:
            x, y = self.place_along(leg, x, y, clock)
        return x, y

    def place_along(self, leg: Leg, x: Scalar, y: Scalar, clock: Scalar) -> tuple[Scalar, Scalar]:
        """Return its place x, y [m] at a time [s] of its clock, from where a leg starts."""
        distance = distance_after(clock - leg.start, leg.length, self.v_max, self.a_max)
        share = distance / leg.length
        return x + share * leg.dx, y + share * leg.dy

    def advance(self, clock: Scalar, time: Real) -> Scalar:
        """Return its clock [s] after a time [s], which may be negative."""
        return jnp.mod(clock + time, self.period)

    @abstractmethod
    def check(self, name: str, walls: Walls) -> None:
        """Refuse impossible numbers."""


class Shuttle(AbstractTimed):
    """A capsule that goes along waypoints and back again, and comes to rest at each.

    Attributes:
        waypoints: x, y of its centre [m], in order.
        hx, hy: from its centre to an end of its axis [m]; 0 for a disc.
        radius: distance of its outline from its axis [m].
        v_max: top speed [m/s].
        a_max: largest acceleration [m/s^2].
        pause: for how long it rests at a waypoint [s].
    """

    waypoints: Corners
    hx: Real = 0.0
    hy: Real = 0.0
    radius: Real = 0.25
    v_max: Real = 0.8
    a_max: Real = 0.5
    pause: Real = 0.0

    @property
    def origin(self) -> tuple[Real, Real]:
        """The first waypoint [m]."""
        return self.waypoints[0]

    @property
    def legs(self) -> list[Leg]:
        """The ways to the waypoints there and back."""
        return self._legs_and_end()[0]

    @property
    def period(self) -> Real:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The time there and back with all pauses [s]."""
        return self._legs_and_end()[1]

    def _legs_and_end(self) -> tuple[list[Leg], Scalar]:
        """Return the legs, and the time [s] at the end of the last one."""
        route = [*self.waypoints, *self.waypoints[-2::-1]]
        legs: list[Leg] = []
        time = jnp.zeros(())
        for (x, y), (next_x, next_y) in pairwise(route):
            dx, dy = (jnp.asarray(d, jnp.float32) for d in (next_x - x, next_y - y))
            legs.append(Leg(time, dx, dy))
            time = time + duration(legs[-1].length, self.v_max, self.a_max) + self.pause
        return legs, time

    def check(self, name: str, walls: Walls) -> None:
        """Refuse impossible numbers, and waypoints outside the walls or on top of each other."""
        check_limits(name, self.radius, self.v_max, self.a_max)
        require(self.pause >= 0, f"{name}.pause", self.pause, "0 s or more")
        points = np.asarray(self.waypoints, float)
        count = len(points)
        bound = f"2 to {MOST_WAYPOINTS}; give [x, y] of each, in order"
        is_list = points.ndim == 2 and points.shape[1] == 2 and 2 <= count <= MOST_WAYPOINTS
        require(is_list, f"{name}.waypoints", f"{count} in number", bound)
        for number, (x, y) in enumerate(points.tolist()):
            bound = f"inside the walls {walls.sides}; move it"
            require(walls.enclose(x, y), f"{name}.waypoints[{number}]", (x, y), bound)
        least = np.hypot(*np.diff(points, axis=0).T).min()
        bound = "more than 0.01 m between neighbours; leave one of them out"
        require(least > 0.01, f"{name}.waypoints", f"{least:g} m apart", bound)


class Door(AbstractTimed):
    """A capsule that slides along its own axis, by its own length, open and shut by the clock.

    Attributes:
        x, y: its centre where it is shut [m].
        hx, hy: from there to the end of its axis towards which it opens [m].
        radius: distance of its outline from its axis [m].
        period: time from one opening to the next [s].
        share_open: share of the period after which it closes.
        v_max: top speed [m/s].
        a_max: largest acceleration [m/s^2].
    """

    x: Real
    y: Real
    hx: Real
    hy: Real
    radius: Real = 0.05
    period: Real = 20.0
    share_open: Real = 0.5
    v_max: Real = 0.5
    a_max: Real = 0.5

    @property
    def origin(self) -> tuple[Real, Real]:
        """Its centre where it is shut [m]."""
        return self.x, self.y

    @property
    def legs(self) -> list[Leg]:
        """The move by which it opens, and the one by which it closes."""
        dx, dy = (2 * jnp.asarray(half, jnp.float32) for half in (self.hx, self.hy))
        closing = jnp.asarray(self.share_open * self.period, jnp.float32)
        return [Leg(jnp.zeros(()), dx, dy), Leg(closing, -dx, -dy)]

    def check(self, name: str, walls: Walls) -> None:
        """Refuse impossible numbers, and a period too short to open and close in."""
        check_limits(name, self.radius, self.v_max, self.a_max)
        half = float(np.hypot(self.hx, self.hy))
        require(half > 0.01, f"{name}.hx, hy", (self.hx, self.hy), "longer than 0.01 m")
        bound = f"inside the walls {walls.sides}; move it"
        require(walls.enclose(self.x, self.y), f"{name} centre", (self.x, self.y), bound)
        is_share = 0 < self.share_open < 1
        require(is_share, f"{name}.share_open", self.share_open, "between 0 and 1")
        needed = float(duration(jnp.float32(2 * half), self.v_max, self.a_max))
        shortest = needed / min(self.share_open, 1 - self.share_open)
        bound = f"at least {shortest:.3g} s, to open and to close in; it needs {needed:.3g} s each"
        require(self.period >= shortest, f"{name}.period", self.period, bound)


def check_limits(name: str, radius: Real, v_max: Real, a_max: Real) -> None:
    """Refuse a mover without a size, and one that cannot move.

    Args:
        name: of the mover, for messages.
        radius: its radius [m].
        v_max: its top speed [m/s].
        a_max: its largest acceleration [m/s^2].
    """
    require(radius > 0, f"{name}.radius", radius, "more than 0 m")
    require(v_max > 0, f"{name}.v_max", v_max, "more than 0 m/s")
    require(a_max > 0, f"{name}.a_max", a_max, "more than 0 m/s^2")


def distance_after(time: Scalar, length: Scalar, v_max: Real, a_max: Real) -> Scalar:
    """Return the distance [m] covered some time after the start of a leg.

    Args:
        time: since the start [s]; before it, negative.
        length: of the leg [m].
        v_max: top speed [m/s].
        a_max: largest acceleration [m/s^2].
    """
    peak = _peak_speed(length, v_max, a_max)
    ramp = peak / a_max
    cruise = length / peak - ramp
    rising = jnp.clip(time, 0.0, ramp)
    steady = jnp.clip(time - ramp, 0.0, cruise)
    falling = jnp.clip(time - ramp - cruise, 0.0, ramp)
    distance = a_max / 2 * rising**2 + peak * steady + falling * (peak - a_max / 2 * falling)
    return jnp.minimum(distance, length)


def duration(length: Scalar, v_max: Real, a_max: Real) -> Scalar:
    """Return the time of a leg [s], from a length [m], top speed [m/s] and acceleration [m/s^2]."""
    peak = _peak_speed(length, v_max, a_max)
    return length / peak + peak / a_max


def _peak_speed(length: Scalar, v_max: Real, a_max: Real) -> Scalar:
    """Return the top speed on a leg [m/s], which a short one does not reach."""
    return jnp.minimum(v_max, jnp.sqrt(a_max * length))
