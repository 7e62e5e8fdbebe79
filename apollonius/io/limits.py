"""How many there may be of whatever is counted: no more than memory has room for, and than counters can hold.

Every count that a person can ask for has its bound here. The bytes of each are measured, rounded up.
"""

import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import SupportsIndex

from apollonius.io.errors import InvalidInput, require

_UNKNOWN = 8 * 2**30
"""Memory [bytes] that is taken for granted where the system does not tell."""
_GROUP_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
"""Files in which Linux tells how much memory a container may have, by version of its control groups."""
GAME_FILES = (".toml", ".json")
"""How the files of games end."""
MOST_COUNTED = 2**31 - 1
"""What a counter of 32 bits can hold."""


def available_memory() -> int:
    """Memory that this process can have at most [bytes]: the machine's, or its container's where that is less."""
    try:
        available = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        available = _UNKNOWN
    for limit in _GROUP_LIMITS:
        with suppress(OSError, ValueError):  # there is none, or it says "max"
            available = min(available, int(Path(limit).read_text()))
    return available


@dataclass(frozen=True)
class Counted:
    """Something that a person can ask for so many of."""

    bytes_each: int
    """Memory that one takes."""
    most: int = MOST_COUNTED
    """How many there may be however large the memory is."""
    least: int = 1
    """How few there may be."""

    @property
    def limit(self) -> int:
        """How many there may be on this machine."""
        return min(self.most, available_memory() // self.bytes_each) if self.bytes_each else self.most

    def bound(self) -> str:
        """What a number of them must be, in words."""
        limit, memory = self.limit, available_memory() / 2**30
        room = f", for which {memory:,.1f} GiB of memory have room" if limit < self.most else ""
        return f"a whole number, at least {self.least}, at most {limit:,}{room}"

    def require(self, name: str, count: object) -> None:
        """Refuse a number of them that there cannot be.

        Raises:
            InvalidInput: if it is too small or too large.
        """
        whole = (
            count.__index__() if isinstance(count, SupportsIndex) and not isinstance(count, bool) else self.least - 1
        )
        require(self.least <= whole <= self.limit, name, count, self.bound())


def require_memory(name: str, value: object, needed: int, remedy: str) -> None:
    """Refuse what this machine has no room for.

    Args:
        name: what the value is called where it was given.
        value: what was given.
        needed: memory that it takes [bytes].
        remedy: what to do instead.

    Raises:
        InvalidInput: with the memory needed and the memory there is.
    """
    available = available_memory()
    if needed > available:
        raise InvalidInput(
            f"{name} = {value} needs {needed / 2**30:,.1f} GiB of memory and this machine has "
            f"{available / 2**30:,.1f} GiB: {remedy}."
        )


GAMES = Counted(250)
"""Games of a match: where they start, how they end, and what is known of them."""
RECORDS = Counted(250, least=0)
"""Games of a match that are written as replays, one after the other."""
SIMULATED_GAMES = Counted(100_000)
"""Games between robots with bodies: the physics of each, and all its states."""
PARALLEL_GAMES = Counted(2_500)
"""Games that are played at a time, with what training keeps of them."""
TRANSITIONS = Counted(100)
"""Transitions of one side that training keeps, or learns from at a time."""
HOLD = Counted(500_000)
"""Control steps for which an action is held: the ways of all nine actions from every node of a usual grid."""
JOINT_HOLD = Counted(0, most=127)
"""The same where both robots move: the steps until a capture are kept in seven bits."""
SEEDS = Counted(5_000_000)
"""Seeds of a study: the games of some twenty matches of each."""
STUDY_GAMES = Counted(500)
"""Games in a match of a study, over all its seeds: some twenty matches of them."""
RESPONSES = Counted(10_000)
"""Opponents that are trained one after the other."""
ENV_STEPS = Counted(0, most=2**30 - 1)
"""Env steps of a training: its counter holds no more."""
SEED = Counted(0, most=2**32 - 1, least=0)
"""What a seed of random numbers can be."""
PORT = Counted(0, most=2**16 - 1)
"""Port of a server."""
ROBOTS = Counted(0, most=16)
"""Robots of a side: each takes some time to compile."""
DISCS = Counted(0, most=250, least=0)
"""Discs of an arena."""
