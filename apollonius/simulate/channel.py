"""A drive's answer to commands of one kind, speeds or turn rates, in closed form: late, no faster
than its limits, and with the lag of its controller.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, inf

import numpy as np
from jaxtyping import Float

_LEAST_LAG = 1e-5
"""A shorter lag [s] counts as this."""


@dataclass(frozen=True)
class ChannelLimits:
    """The limits of the reference that a drive follows, as `References` has it: of a speed [m/s] or
    of a turn rate [rad/s]. Infinity stands for no limit.

    Attributes:
        highest: largest value ahead, or to the left.
        lowest: largest value backwards, or to the right, as a positive number.
        rise: largest rate at which the value leaves 0 [1/s of its unit].
        fall: largest rate at which it returns to 0.
    """

    highest: float = inf
    lowest: float = inf
    rise: float = inf
    fall: float = inf


@dataclass(frozen=True)
class Commands:
    """Commands that hold, each from its time [s] on until the next one; `start` is the value that
    the drive has before.
    """

    times: Float[np.ndarray, " commands"]
    values: Float[np.ndarray, " commands"]
    start: float = 0.0

    def changes(self) -> list[tuple[float, float]]:
        """Return the time and the value of each command that differs from the one before."""
        is_new = np.diff(self.values, prepend=np.nan) != 0
        return list(zip(self.times[is_new].tolist(), self.values[is_new].tolist(), strict=True))


@dataclass
class _Ramps:
    """Pieces of a reference, on each of which it is linear: beginnings [s], values and slopes."""

    times: list[float]
    values: list[float]
    slopes: list[float]

    def add(self, time: float, value: float, slope: float) -> None:
        self.times.append(time)
        self.values.append(value)
        self.slopes.append(slope)


def _stages(value: float, target: float, limits: ChannelLimits) -> Sequence[tuple[float, float]]:
    """Return the values that lie before a target, the target included, and the rates towards
    them.
    """
    if value * target < 0:
        return (0.0, limits.fall), (target, limits.rise)
    return ((target, limits.rise if abs(target) > abs(value) else limits.fall),)


def _reference(commands: Commands, limits: ChannelLimits) -> _Ramps:
    """Return the reference of commands that take effect at once."""
    ramps = _Ramps([], [], [])
    value = commands.start
    changes = commands.changes()
    ends = [time for time, _ in changes[1:]] + [inf]
    for (time, command), end in zip(changes, ends, strict=True):
        target = min(max(command, -limits.lowest), limits.highest)
        for goal, rate in _stages(value, target, limits):
            duration = abs(goal - value) / rate
            if duration > 0 and time < end:
                slope = rate if goal > value else -rate
                ramps.add(time, value, slope)
                is_reached = time + duration <= end
                value = goal if is_reached else value + slope * (end - time)
                time = time + duration if is_reached else end
            elif time < end:
                value = goal
        if time < end:
            ramps.add(time, value, 0.0)
    return ramps


def channel_response(
    commands: Commands, limits: ChannelLimits, lag: float, at: Float[np.ndarray, " samples"]
) -> Float[np.ndarray, " samples"]:
    """Return the value that a drive has at some times [s] after commands that take effect at once.

    The reference is linear on each of its pieces, so the first-order lag has a closed form there.
    The result is continuous in every argument, and a latency is a shift of `at`.

    Args:
        commands: The commands.
        limits: The limits of the reference.
        lag: Time constant with which the value takes up the reference [s].
        at: The times.
    """
    ramps = _reference(commands, limits)
    lag = max(lag, _LEAST_LAG)
    value = commands.start
    offsets: list[float] = []
    lasts = [*np.diff(ramps.times).tolist(), 0.0]
    for reference, slope, duration in zip(ramps.values, ramps.slopes, lasts, strict=True):
        offset = value - reference + slope * lag
        offsets.append(offset)
        value = reference + slope * (duration - lag) + offset * exp(-duration / lag)
    pieces = np.searchsorted(ramps.times, at, side="right") - 1
    times, references, slopes = map(np.array, (ramps.times, ramps.values, ramps.slopes))
    since = np.maximum(at - times[pieces], 0.0)
    faded = np.array(offsets)[pieces] * np.exp(-since / lag)
    values = references[pieces] + slopes[pieces] * (since - lag) + faded
    return np.where(pieces < 0, commands.start, values)
