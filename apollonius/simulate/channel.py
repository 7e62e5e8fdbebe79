"""A drive's answer to commands of one kind, speeds or turn rates, in closed form: late, no faster
than its limits, and with the lag of its controller.
"""

from dataclasses import dataclass
from functools import cached_property
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

    @cached_property
    def changes(self) -> list[tuple[float, float, float]]:
        """The time and the value of each command that differs from the one before, and the time of
        the next such one.
        """
        is_new = np.diff(self.values, prepend=np.nan) != 0
        times = self.times[is_new].tolist()
        return list(zip(times, self.values[is_new].tolist(), [*times[1:], inf], strict=True))


Ramp = tuple[float, float, float]
"""A piece of a reference, on which it is linear: its beginning [s], value there and slope."""


def _reference(commands: Commands, limits: ChannelLimits) -> list[Ramp]:
    """Return the reference of commands that take effect at once."""
    ramps: list[Ramp] = []
    value = commands.start
    for time, command, end in commands.changes:
        target = min(max(command, -limits.lowest), limits.highest)
        while value != target and time < end:
            goal = 0.0 if value * target < 0 else target
            rate = limits.rise if abs(goal) > abs(value) else limits.fall
            reached = time + abs(goal - value) / rate
            slope = rate if goal > value else -rate
            if reached > time:
                ramps.append((time, value, slope))
            value = goal if reached <= end else value + slope * (end - time)
            time = min(reached, end)
        if time < end:
            ramps.append((time, value, 0.0))
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
    ends = [time for time, _, _ in ramps[1:]] + [ramps[-1][0]]
    for (time, reference, slope), end in zip(ramps, ends, strict=True):
        offset = value - reference + slope * lag
        offsets.append(offset)
        value = reference + slope * (end - time - lag) + offset * exp((time - end) / lag)
    times, references, slopes = np.array(ramps).T
    pieces = np.searchsorted(times, at, side="right") - 1
    since = np.maximum(at - times[pieces], 0.0)
    faded = np.array(offsets)[pieces] * np.exp(-since / lag)
    values = references[pieces] + slopes[pieces] * (since - lag) + faded
    return np.where(pieces < 0, commands.start, values)
