"""A player that `apollonius export --to c` wrote, compiled to a shared library. Plain Python: no
ROS, no Apollonius.
"""

import ctypes
import json
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

NUMBERS = {
    "float32": ctypes.c_float,
    "int32": ctypes.c_int32,
    "uint32": ctypes.c_uint32,
    "bool": ctypes.c_uint8,
}


class Export:
    """An exported player, which remembers what the player does, and nothing else.

    Attributes:
        text: the `.robot.json` file.
        facts: what it says.
        robots: the number of robots: its own, its mates, its opponents.

    Raises:
        ValueError: where a file is missing, older than its source, or of another export; for a
            game with movers.
    """

    def __init__(self, file: Path) -> None:
        self.text = file.read_text(encoding="utf-8")
        self.facts = json.loads(self.text)
        self.robots = 1 + self.facts["mates"] + self.facts["opponents"]
        if self.facts["game"].get("movers"):
            raise ValueError(f"{file}: of a game with movers, which no topic tells; leave them out")
        base, name = file.resolve().parent, self.facts["name"]
        library, source = base / f"{name}.so", base / f"{name}.c"
        if not library.exists() or (
            source.exists() and source.stat().st_mtime > library.stat().st_mtime
        ):
            command = f"gcc -std=c99 -O2 -shared -fPIC {source} -lm -o {library}"
            raise ValueError(f"{library}: missing, or older than its source; give {command}")
        self._function = getattr(ctypes.CDLL(str(library)), name)
        self._results = {
            one["name"]: ctypes.create_string_buffer(one["bytes"]) for one in self.facts["results"]
        }
        self._given = {
            one["name"]: self._content(base / name, one) for one in self.facts["arguments"]
        }
        self._first = bytes(self._given.get("memory", b""))

    @staticmethod
    def _content(base: Path, fact: dict) -> ctypes.Array:
        """Return memory for an argument, with what its file holds if it has one."""
        if fact["sha256"] is None:
            return ctypes.create_string_buffer(fact["bytes"])
        file = base.with_suffix(f".{fact['name']}")
        content = file.read_bytes()
        if sha256(content).hexdigest() != fact["sha256"]:
            raise ValueError(
                f"{file}: not as it was exported; copy all files of one export together"
            )
        return ctypes.create_string_buffer(content, fact["bytes"])

    def begin(self) -> None:
        """Forget the game so far."""
        if self._first:
            ctypes.memmove(self._given["memory"], self._first, len(self._first))

    def decide(
        self, states: Sequence[Sequence[float]], active: Sequence[bool], bits: int
    ) -> tuple[list[float], list[float]]:
        """Return the action, a number from 0 to 8 or two shares, and the controls u1 [m/s^2] and u2
        [rad/s].

        Args:
            states: x [m], y [m], v [m/s] and heading [rad] of its own robot, its mates and its
                opponents.
            active: whether each is in play.
            bits: 32 random bits.
        """
        values = {
            "state": (ctypes.c_float * (4 * self.robots))(
                *(number for state in states for number in state)
            ),
            "active": (ctypes.c_uint8 * self.robots)(*active),
            "bits": ctypes.c_uint32(bits),
        }
        given = []
        for fact in self.facts["arguments"]:
            value = values.get(fact["name"], self._given[fact["name"]])
            kind = NUMBERS.get(fact["number"])
            given.append(value if kind is None else kind.from_buffer_copy(value))
        self._function(*given, *self._results.values())
        if self._first:
            ctypes.memmove(self._given["memory"], self._results["next_memory"], len(self._first))
        action, controls = (
            self._results["action"].raw,
            (ctypes.c_float * 2).from_buffer(self._results["controls"]),
        )
        chosen = ctypes.c_int32 if len(action) == 4 else ctypes.c_float * 2
        made = chosen.from_buffer_copy(action)
        return [made.value] if len(action) == 4 else list(made), list(controls)
