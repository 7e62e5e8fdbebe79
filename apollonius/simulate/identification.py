"""The numbers of a robot's drive and odometry, each with an interval, or with what to record so
that it has one.
"""

from dataclasses import dataclass
from math import exp, inf, sqrt

import numpy as np
from jaxtyping import Float, Int

from apollonius.io.errors import require
from apollonius.simulate.drive_fit import (
    CHANNELS,
    DELAYS,
    QUANTILE,
    DriveFit,
    correlation_time,
    fit_drive,
)
from apollonius.simulate.drive_record import DriveRecord

LIMIT_ERROR = 0.02
"""Share by which intervals of limits are wider than the errors of the fit, for slip, rolling
resistance and inexact controllers, which the model leaves out. In simulation its limits were 1 %
off.
"""
DELAY_ERROR = 0.01
"""Time by which intervals of delays are wider [s], for the lags of motors and masses. In simulation
delays were 6 ms off.
"""
_WIDEST = 0.25
"""A delay whose interval reaches further [s] is not identified."""
_SHORT_LAG = 0.005
"""A lag [s] whose standard error says nothing."""
_LEAST_REST = 3.0
"""Rest that the noise of sensors is measured in, in stretches of a second and more [s]."""
_STILL = 0.002
"""A model that moves by less [m/s, rad/s] rests."""
_MOVING = 0.02
"""Standard deviation of a channel that moves [m/s, rad/s], beside noise."""
_EXPLAINED = 0.5
"""The least share of a channel's variance that commands must explain if they were meant for it."""


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval; without a value, `low` is the least that is possible and
    `remedy` says what to record.
    """

    value: float | None
    low: float
    high: float
    unit: str
    remedy: str = ""


@dataclass(frozen=True)
class _Limit:
    """A limit of a robot: the lowest of some limits of the drive.

    Attributes:
        sides: parameters of a `DriveFit`.
        unit: its unit.
        remedy: what to record.
    """

    sides: tuple[str, ...]
    unit: str
    remedy: str


_LIMITS = {
    "v_max": _Limit(
        ("speed highest",),
        "m/s",
        "command a higher speed and hold it until the robot gains no more",
    ),
    "u1_max": _Limit(
        ("speed rise", "speed fall"),
        "m/s^2",
        "command full speed from rest, and rest from full speed",
    ),
    "u2_max": _Limit(
        ("turn_rate highest", "turn_rate lowest"),
        "rad/s",
        "command faster turns to both sides and hold them until the turn rate levels off",
    ),
    "turn_acceleration": _Limit(
        ("turn_rate rise", "turn_rate fall"),
        "rad/s^2",
        "command full turns from one side to the other at once",
    ),
}
_NOISE_UNITS = {"position": "m", "heading": "rad", "speed": "m/s", "turn_rate": "rad/s"}


@dataclass(frozen=True)
class Identification:
    """A robot's drive and the noise of its odometry, as a record shows them.

    Attributes:
        drive: `v_max`, `u1_max`, `u2_max`, `turn_acceleration`, `latency` and `lag`.
        noise: standard deviations of `position`, `heading`, `speed` and `turn_rate` at rest.
    """

    drive: dict[str, Estimate]
    noise: dict[str, Estimate]


def identify(record: DriveRecord) -> Identification:
    """Identify a robot's drive and the noise of its odometry.

    Raises InvalidInput for a record whose motion the commands do not explain.
    """
    fit = fit_drive(record)
    for channel in CHANNELS:
        _require_explained(fit, channel)
    drive = {name: _limit(fit, limit) for name, limit in _LIMITS.items()}
    drive |= {name: _delay(fit, name) for name in DELAYS}
    return Identification(drive, _noise(fit))


def _require_explained(fit: DriveFit, channel: str) -> None:
    """Refuse a record in which a robot moves otherwise than it is commanded."""
    measured = getattr(fit.record, channel)[fit.samples]
    noise = np.var(np.diff(measured)) / 2
    motion = np.var(measured) - noise
    error = np.mean((fit.model(channel) - measured) ** 2) - noise
    share = 1 - error / motion if motion > _MOVING**2 else 1.0
    bound = (
        f"at least {_EXPLAINED:.0%}; name the commands and the odometry of one robot, "
        "which nothing else drives"
    )
    name = f"share of the {channel.replace('_', ' ')} that the commands explain"
    require(share >= _EXPLAINED, name, f"{max(share, 0):.0%}", bound)


def _limit(fit: DriveFit, limit: _Limit) -> Estimate:
    """Return the lowest of some limits, if the record shows one and that no other is lower.

    The interval reaches from the lowest lower end to the lowest upper end.
    """
    shown = [side for side in limit.sides if fit.parameters[side] < inf]
    hidden = [side for side in limit.sides if side not in shown]
    values = {side: fit.parameters[side] for side in shown}
    reaches = {side: QUANTILE * fit.standard_errors[side] + LIMIT_ERROR for side in shown}
    lows = [values[side] * exp(-reaches[side]) for side in shown]
    highs = [values[side] * exp(reaches[side]) for side in shown]
    possible = [fit.least_possible(side) for side in hidden]
    low = min([*lows, *possible])
    is_lowest = bool(shown) and low >= min(lows)
    if not is_lowest:
        return Estimate(None, low, inf, limit.unit, limit.remedy)
    return Estimate(min(values.values()), low, min(highs), limit.unit)


def _delay(fit: DriveFit, name: str) -> Estimate:
    """Return a delay; its interval is the wider of those by its standard error and by its profile.

    Next to no lag the profile alone counts: there, the derivatives by lag and latency are equal.
    """
    value = fit.parameters[name]
    has_lag = fit.parameters["lag"] > _SHORT_LAG
    reach = QUANTILE * fit.standard_errors[name] if has_lag else 0.0
    low = fit.furthest_delay(name, -reach, -_WIDEST) - DELAY_ERROR
    high = fit.furthest_delay(name, reach, _WIDEST) + DELAY_ERROR
    if high - value > _WIDEST:
        return Estimate(None, max(low, 0.0), inf, "s", "command more steps of speed and turn rate")
    return Estimate(value, max(low, 0.0), high, "s")


def _noise(fit: DriveFit) -> dict[str, Estimate]:
    """Return the standard deviations of a robot's odometry while the model rests, over the means of
    each rest.
    """
    rests = list(_rests(fit))
    record = fit.record
    heading = np.unwrap(record.heading)
    columns = {
        "position": (record.x, record.y),
        "heading": (heading,),
        "speed": (record.speed,),
        "turn_rate": (record.turn_rate,),
    }
    duration = sum(float(np.ptp(record.times[rest])) for rest in rests)
    if duration < _LEAST_REST:
        remedy = "record the robot at rest for ten seconds, with commands of 0"
        return {name: Estimate(None, 0.0, inf, unit, remedy) for name, unit in _NOISE_UNITS.items()}
    return {
        name: _spread_of([part[rest] for part in parts for rest in rests], _NOISE_UNITS[name])
        for name, parts in columns.items()
    }


def _rests(fit: DriveFit) -> list[Int[np.ndarray, " _"]]:
    """Return the numbers of the odometries of each rest of a second or more, without its first half
    second.
    """
    samples = fit.samples
    times = fit.record.times[samples]
    moves = np.maximum(*(np.abs(fit.model(channel)) for channel in CHANNELS)) > _STILL
    edges = np.flatnonzero(np.diff(moves, prepend=True, append=True))
    rests: list[np.ndarray] = []
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        rest = np.arange(first, end)
        rest = rest[times[rest] >= times[first] + 0.5]
        if len(rest) > 2 and np.ptp(times[rest]) >= 0.5:
            rests.append(samples[rest])
    return rests


def _spread_of(stretches: list[Float[np.ndarray, " _"]], unit: str) -> Estimate:
    """Return the standard deviation about the mean of each stretch.

    Its error is that of a variance of correlated values with the tails that these have, at least
    those of a normal distribution.
    """
    errors = np.concatenate([values - values.mean() for values in stretches])
    count = len(errors) - len(stretches)
    variance = float(errors @ errors) / count
    if variance == 0:
        return Estimate(0.0, 0.0, 0.0, unit)
    tails = max(float(np.mean(errors**4)) / variance**2, 3.0)
    correlation = correlation_time(errors)
    reach = QUANTILE * sqrt((tails - 1) * correlation / count) / 2
    value = sqrt(variance)
    return Estimate(value, value * exp(-reach), value * exp(reach), unit)
