"""A suite of arenas: a published list of what each is drawn by, and of the digests that say whether it came out alike.

Agents that should play on maps they have never seen learn in its part `train`, and are judged in `held-out`, which has
kinds of arenas that training never saw. Robots of radius up to 0.3 m can go everywhere in all of them.

Longer sides were drawn log-uniformly from 6 to 30 m, the shorter ones as two thirds of them or more, gaps uniformly
from a fourteenth of the longer side, 0.8 m at least, to a seventh.
"""

import functools
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import dacite
import numpy as np

from apollonius.arenas.names import PARTS, SUITES
from apollonius.arenas.random_arena import random_arena
from apollonius.errors import require
from apollonius.game.arena import Arena


@dataclass(frozen=True)
class Entry:
    """One arena of a suite.

    Attributes:
        name: within the suite.
        part: one of `PARTS`.
        kind: of random arenas, or `gallery` for one that ships with the package, of the same name.
        width, height: of the arena that was asked for [m].
        sha256: `digest` of the arena.
        gap: least width of its passages [m]; of what is in the gallery, nothing is asked.
        seed: of its random numbers.
    """

    name: str
    part: str
    kind: str
    width: float
    height: float
    sha256: str = ""
    gap: float | None = None
    seed: int | None = None

    def draw(self) -> Arena:
        """The arena, whatever its digest.

        Raises:
            InvalidInput: as `random_arena`.
        """
        if self.kind == "gallery":
            from apollonius.arenas.file import find_game  # which finds the games of suites, too

            return find_game(self.name).arena
        assert self.seed is not None, "what is drawn has a seed"
        assert self.gap is not None, "what is drawn has a gap"
        return random_arena(self.kind, self.seed, gap=self.gap, width=self.width, height=self.height)


def suite_entries(suite: str, part: str | None = None) -> tuple[Entry, ...]:
    """The arenas of a suite, or of one of its parts, in their order.

    Raises:
        InvalidInput: for an unknown suite or part.
    """
    require(suite in SUITES, "suite", suite, f"one of {', '.join(SUITES)}")
    require(part is None or part in PARTS, "part", part, f"one of {', '.join(PARTS)}")
    return tuple(entry for entry in _published(suite) if part in (None, entry.part))


def suite_names(suite: str, part: str | None = None) -> tuple[str, ...]:
    """Their names; errors are those of `suite_entries`."""
    return tuple(entry.name for entry in suite_entries(suite, part))


def suite_arena(suite: str, name: str) -> Arena:
    """One arena of a suite.

    Raises:
        InvalidInput: for an unknown suite or name, and where what is drawn is not what was published.
    """
    entries = {entry.name: entry for entry in suite_entries(suite)}
    some = f"one of {', '.join(list(entries)[:2])} ...; `apollonius arena suite` lists them"
    require(name in entries, f"arena of {suite}", name, some)
    arena = entries[name].draw()
    bound = f"{entries[name].sha256[:12]}... as published; draw it with the version that published it"
    found = digest(arena)
    require(found == entries[name].sha256, f"SHA-256 of {suite}/{name}", f"{found[:12]}...", bound)
    return arena


def digest(arena: Arena) -> str:
    """SHA-256 of an arena, the same on every machine: of its numbers to a micrometre, and of its cells as bits."""
    lines = ["walls", _text([arena.x_min, arena.x_max, arena.y_min, arena.y_max])]
    for disc in arena.discs:
        lines += ["disc", _text([disc.x, disc.y, disc.radius])]
    for polygon in arena.polygons:
        lines += ["polygon", *[_text(corner) for corner in polygon.vertices]]
    content = "\n".join(lines).encode()
    if arena.map:
        cells = arena.map.occupied()
        content += (
            f"\nmap {cells.shape[0]} {cells.shape[1]} {_text([arena.map.x, arena.map.y, arena.map.cell])}\n".encode()
        )
        content += np.packbits(cells).tobytes()
    return hashlib.sha256(content).hexdigest()


def _text(numbers: Sequence[object]) -> str:
    """Numbers to six places; 0 has no sign."""
    return " ".join(f"{round(float(number), 6) + 0.0:.6f}" for number in numbers)  # pyright: ignore[reportArgumentType]


@functools.cache
def _published(suite: str) -> tuple[Entry, ...]:
    """What the suite's file says."""
    data = json.loads((Path(__file__).parent / f"{suite}.json").read_text(encoding="utf-8"))
    return tuple(dacite.from_dict(Entry, one, dacite.Config(strict=True, cast=[tuple])) for one in data["arenas"])
