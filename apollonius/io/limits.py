"""Upper bounds of counts, by measured memory and by the size of counters."""

import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import SupportsIndex

from apollonius.io.errors import InvalidInput, require

_UNKNOWN = 8 * 2**30
"""Memory [bytes] that is assumed where the system does not say."""
_GROUP_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
"""Files with the memory limit of a Linux container, by version of its control groups."""
ONNX = ".onnx"
"""Suffix of the files of agents from outside."""
GAME_FILES = (".toml", ".json")
"""Suffixes of game files."""
MOVING = (".gif", ".webp")
"""Suffixes of moving pictures."""
MOST_COUNTED = 2**31 - 1
"""Largest number in a counter of 32 bits."""


def available_memory() -> int:
    """Return the memory of this machine, or of its container where that is less [bytes]."""
    try:
        available = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        available = _UNKNOWN
    for limit in _GROUP_LIMITS:
        with suppress(OSError, ValueError):  # there is none, or it says "max"
            available = min(available, int(Path(limit).read_text(encoding="utf-8")))
    return available


@dataclass(frozen=True)
class CountLimit:
    """The bounds of a count: by the memory for one [bytes], and `least` and `most` for any
    memory.
    """

    bytes_each: int
    most: int = MOST_COUNTED
    least: int = 1

    @property
    def limit(self) -> int:
        """The upper bound on this machine."""
        if not self.bytes_each:
            return self.most
        return min(self.most, available_memory() // self.bytes_each)

    def bound(self) -> str:
        """Return the bounds in words."""
        limit, memory = self.limit, available_memory() / 2**30
        room = f", for which {memory:,.1f} GiB of memory have room" if limit < self.most else ""
        return f"a whole number, at least {self.least}, at most {limit:,}{room}"

    def require(self, name: str, count: object) -> None:
        """Refuse, by InvalidInput, a count that is no whole number within the bounds."""
        is_within = False
        if isinstance(count, SupportsIndex) and not isinstance(count, bool):
            is_within = self.least <= count.__index__() <= self.limit
        require(is_within, name, count, self.bound())


def require_memory(name: str, value: object, needed_bytes: int, remedy: str) -> None:
    """Raise InvalidInput for a value that needs more memory than this machine has.

    Args:
        name: Name of the value.
        value: The value.
        needed_bytes: Memory that it needs [bytes].
        remedy: What to do instead, for the message.
    """
    available = available_memory()
    if needed_bytes > available:
        raise InvalidInput(
            f"{name} = {value} needs {needed_bytes / 2**30:,.1f} GiB of memory "
            "and this machine has "
            f"{available / 2**30:,.1f} GiB: {remedy}."
        )


GAMES = CountLimit(250)
"""Games of a match, with their starts and results."""
RECORDS = CountLimit(250, least=0)
"""Games of a match that are written as replays."""
SIMULATED_GAMES = CountLimit(100_000)
"""Games between robots with bodies: the physics of each, and all its states."""
PARALLEL_GAMES = CountLimit(2_500)
"""Games that are played at a time, with their share of the replay buffer."""
TRANSITIONS = CountLimit(100)
"""Transitions of one side in a replay buffer or a batch."""
HOLD = CountLimit(500_000)
"""Control steps for which an action is held: the paths of all nine actions from every node of a
usual grid.
"""
JOINT_HOLD = CountLimit(0, most=127)
"""Control steps for which an action is held where both robots move: those until a capture have
seven bits.
"""
SEEDS = CountLimit(5_000_000)
"""Seeds of a study: the games of some twenty matches of each."""
STUDY_GAMES = CountLimit(500)
"""Games in a match of a study, over all its seeds, in some twenty matches."""
TRAININGS = CountLimit(0, most=1000)
"""Trainings of a sweep: as many as a usual array of Slurm."""
RESPONSES = CountLimit(10_000)
"""Opponents that are trained one after the other."""
ENV_STEPS = CountLimit(0, most=2**30 - 1)
"""Env steps of a training: its counter holds no more."""
SEED = CountLimit(0, most=2**32 - 1, least=0)
"""Seed of random numbers."""
PORT = CountLimit(0, most=2**16 - 1)
"""Port of a server."""
ROBOTS = CountLimit(0, most=16)
"""Robots of a side: each takes some time to compile."""
