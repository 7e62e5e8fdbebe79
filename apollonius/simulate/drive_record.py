"""A robot's drive on record: what it was commanded, and how its odometry says that it moved."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float

from apollonius.io.errors import format_value, require
from apollonius.io.recording import Message, read_topics

LONGEST_HOLD = 0.5
"""A drive may stop by itself where no command comes for so long [s]; 0.5 s is usual."""
_SHORTEST = 10.0
"""Time that commands and odometry must share [s]."""
_SHORTEST_STRETCH = 1.0
"""Time of commands without a pause that is used [s]."""
_LEAST_RATE = 5.0
"""Least rate of odometry, and of commands while they come [1/s]."""
_TAIL = 2.33
"""Standard deviations beyond which a normal distribution has a hundredth."""
_LARGEST = 1e6
"""No place [m], speed or turn rate is beyond this."""
_LEAST_MOTION = 0.05
"""A robot whose speed [m/s] or turn rate [rad/s] varies by less does not move so."""
_LEAST_CHANGE = 0.2
"""Least change of the commands [m/s, rad/s] by which a robot should move."""


@dataclass(frozen=True)
class DriveRecord:
    """Odometry and commands by their times [s]: places [m], heading [rad], speeds [m/s] and turn
    rates [rad/s], these in the robot's own frame.

    Raises:
        InvalidInput: For times that do not increase, numbers that are not finite, a record that is
            too short or has too few commands, and a robot that does not move.
    """

    times: Float[np.ndarray, " samples"]
    x: Float[np.ndarray, " samples"]
    y: Float[np.ndarray, " samples"]
    heading: Float[np.ndarray, " samples"]
    speed: Float[np.ndarray, " samples"]
    turn_rate: Float[np.ndarray, " samples"]
    command_times: Float[np.ndarray, " commands"]
    command_speed: Float[np.ndarray, " commands"]
    command_turn_rate: Float[np.ndarray, " commands"]

    def __post_init__(self) -> None:
        for name, times in (("odometry", self.times), ("commands", self.command_times)):
            bound = f"at least {_LEAST_RATE * _SHORTEST:.0f}; record a longer drive"
            require(len(times) >= _LEAST_RATE * _SHORTEST, f"messages of {name}", len(times), bound)
        for field in fields(self):
            self._require_finite(field.name)
        _require_order("odometry", self.times)
        _require_order("commands", self.command_times)
        self._require_overlap()
        require(
            len(self.times) >= _LEAST_RATE * np.ptp(self.times),
            "rate of the odometry",
            f"{len(self.times) / np.ptp(self.times):.1f}",
            f"at least {_LEAST_RATE:g} a second, and better 20 or more",
        )
        commanded = max(np.ptp(self.command_speed), np.ptp(self.command_turn_rate))
        bound = f"at least {_LEAST_CHANGE}: send speeds and turn rates that change"
        require(commanded >= _LEAST_CHANGE, "change of commands", f"{commanded:.3f}", bound)
        self._require_motion("speed", self.speed, self.command_speed)
        self._require_motion("turn rate", self.turn_rate, self.command_turn_rate)

    def _require_motion(self, name: str, measured: np.ndarray, commanded: np.ndarray) -> None:
        change = float(np.ptp(commanded))
        motion = _motion_range(measured)
        bound = (
            f"at least {_LEAST_MOTION} where {change:.2f} was commanded: the robot did not move; "
            "record it while it does"
        )
        is_possible = motion >= _LEAST_MOTION or change < _LEAST_CHANGE
        require(is_possible, f"change of the {name}", f"{motion:.3f}", bound)

    def _require_finite(self, name: str) -> None:
        values = getattr(self, name)
        wrong = np.flatnonzero(~(np.abs(values) <= (np.inf if "times" in name else _LARGEST)))
        if wrong.size:
            message = f"{name} of message {wrong[0] + 1:,} of {len(values):,}"
            bound = f"a number within {_LARGEST:,.0f} of 0; mend what publishes it, record again"
            require(False, message, values[wrong[0]], bound)

    def _require_overlap(self) -> None:
        spans = (np.ptp(self.times[samples]) for _, samples in self.stretches())
        shared = float(sum(spans))
        name = f"time with odometry and a command every {LONGEST_HOLD:g} s"
        bound = (
            f"at least {_SHORTEST:g} s: record a longer drive, send commands all the time, and "
            "date both by one clock"
        )
        require(shared >= _SHORTEST, name, f"{shared:.1f} s", bound)

    @property
    def duration(self) -> float:
        """From the first odometry to the last [s]."""
        return float(np.ptp(self.times))

    def stretches(self) -> Iterator[tuple[slice, slice]]:
        """Yield the commands, and the odometry during them, of each stretch in which commands came
        without a pause.
        """
        pauses = np.flatnonzero(np.diff(self.command_times) > LONGEST_HOLD) + 1
        edges = [0, *pauses.tolist(), len(self.command_times)]
        for first, end in pairwise(edges):
            begins = self.command_times[first]
            ends = self.command_times[end - 1] + LONGEST_HOLD / 2
            samples = slice(*np.searchsorted(self.times, (begins, ends)).tolist())
            is_long = ends - begins > _SHORTEST_STRETCH
            if is_long and samples.stop - samples.start >= _LEAST_RATE:
                yield slice(first, end), samples


def _motion_range(values: Float[np.ndarray, " samples"]) -> float:
    """Return the range of values, without a hundredth at either end and without that of noise."""
    low, high = np.quantile(values, [0.01, 0.99])
    noise = np.std(np.diff(values)) / np.sqrt(2)
    return max(float(high - low - 2 * _TAIL * noise), 0.0)


def _require_order(name: str, times: Float[np.ndarray, " messages"]) -> None:
    """Refuse times that do not increase."""
    wrong = np.flatnonzero(np.diff(times) <= 0)
    if wrong.size:
        after = f"{times[wrong[0] + 1] - times[wrong[0]]:+.3f} s"
        where = f"step of the stamps of {name} after message {wrong[0] + 1:,}"
        bound = "more than 0: record one robot with one clock, and each topic from one publisher"
        require(False, where, after, bound)


def load_drive_record(folder: Path, odometry: str, commands: str) -> DriveRecord:
    """Read a bag's odometry and commands.

    Messages are dated by their own stamps; a Twist, which has none, by the bag's.

    Args:
        folder: The bag.
        odometry: Topic of the odometry, whole or its end.
        commands: Topic of the commands, whole or its end.

    Raises:
        InvalidInput: As `read_topics` and `DriveRecord`, and for messages of other types.
    """
    readers = {odometry: _motion, commands: _command}
    topics = read_topics(folder, readers, f"'{folder}' is no bag of a drive")
    for name, rows in topics.items():
        require(rows, f"messages of '{format_value(name)}'", 0, "some; record again")
    motions, twists = (np.array(topics[name], float).T for name in (odometry, commands))
    times, command_times = (_nanoseconds(topics[name]) for name in (odometry, commands))
    origin = min(times[0], command_times[0])
    return DriveRecord(
        1e-9 * (times - origin),
        x=motions[1],
        y=motions[2],
        heading=motions[3],
        speed=motions[4],
        turn_rate=motions[5],
        command_times=1e-9 * (command_times - origin),
        command_speed=twists[1],
        command_turn_rate=twists[2],
    )


def _nanoseconds(rows: list[tuple[int | float, ...]]) -> np.ndarray:
    """Return the first column of rows as whole numbers, which a float would round."""
    return np.array([row[0] for row in rows], np.int64)


def _stamp(message: Message) -> int:
    """Return the time of a message [ns]: its own, or else the bag's."""
    header = getattr(message.content, "header", None)
    own = header.stamp.sec * 10**9 + header.stamp.nanosec if header else 0
    return own or message.stamp


def _require_type(message: Message, *types: str) -> None:
    bound = f"{' or '.join(types)}; name another topic"
    require(message.type in types, "type of a message", message.type, bound)


def _motion(message: Message) -> tuple[int | float, ...]:
    """Return the time, x, y, heading, speed and turn rate of an odometry."""
    _require_type(message, "nav_msgs/msg/Odometry")
    place = message.content.pose.pose.position
    turn = message.content.pose.pose.orientation
    twist = message.content.twist.twist
    sine = 2 * (turn.w * turn.z + turn.x * turn.y)
    cosine = 1 - 2 * (turn.y * turn.y + turn.z * turn.z)
    heading = float(np.arctan2(sine, cosine))
    return _stamp(message), place.x, place.y, heading, twist.linear.x, twist.angular.z


def _command(message: Message) -> tuple[int | float, ...]:
    """Return the time, the speed and the turn rate of a command."""
    _require_type(message, "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")
    twist = getattr(message.content, "twist", message.content)
    return _stamp(message), twist.linear.x, twist.angular.z
