"""How `suite-v1` was drawn: sizes and gaps by kind and seed.

`python -m apollonius.arenas.suite_recipe` writes its file anew, to the same bytes.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from itertools import count
from pathlib import Path

import numpy as np

from apollonius.arenas.file import find_game
from apollonius.arenas.suite import Entry, digest
from apollonius.errors import InvalidInput
from apollonius.game.arena import Arena

TRAIN = {"discs": 64, "blocks": 64, "rooms": 64, "maze": 64}
"""Arenas of each kind to learn in."""
HELD_OUT = {"racks": 60, "caves": 60}
"""Arenas of each kind to be judged in, besides the gallery's."""
GALLERY = ("blocks", "courtyard", "maze", "office", "warehouse")
"""Those that ship with the package, by name."""
_LONG = (6.0, 30.0)
"""Shortest and longest of the longer sides [m], drawn log-uniformly."""
_ASPECT = (1.0, 1.5)
"""Smallest and largest ratio of the sides."""
_GAPS = (7.0, 14.0)
"""Fewest and most gaps along the longer side."""
_LEAST_GAP = 0.8
"""Smallest gap [m]: robots of radius 0.3 m go through it with a decimetre on either side."""
_RADIUS = (0.3, 0.8)
"""Smallest and largest radius of a disc, in gaps."""
_DISCS = (0.05, 0.1)
"""Fewest and most discs on a square gap."""
MOST_DISCS, MOST_POLYGONS, MOST_CORNERS = 32, 64, 6
"""How many obstacles an arena to learn in has at most, and how many corners each."""


def entries() -> Iterator[Entry]:
    """All of them, with their digests."""
    for part, kinds in (("train", TRAIN), ("held-out", HELD_OUT)):
        for kind, number in kinds.items():
            drawn = (entry for seed in count() if (entry := drawn_entry(part, kind, seed)))
            for index, entry in zip(range(number), drawn, strict=False):
                yield replace(entry, name=f"{kind}-{index:02}")
    for name in GALLERY:
        arena = find_game(name).arena
        sides = float(arena.x_max - arena.x_min), float(arena.y_max - arena.y_min)
        yield Entry(name, "held-out", "gallery", *sides, digest(arena))


def drawn_entry(part: str, kind: str, seed: int) -> Entry | None:
    """What a seed comes to, without a name; None where nothing finds room, and for too much in an arena to learn in."""
    rng = np.random.default_rng([seed, *kind.encode()])
    long = float(np.exp(rng.uniform(*np.log(_LONG))))
    short = long / rng.uniform(*_ASPECT)
    gap = rng.uniform(max(_LEAST_GAP, long / _GAPS[1]), long / _GAPS[0])
    width, height = (long, short) if rng.integers(2) else (short, long)
    width, height, gap = (round(float(number), 2) for number in (width, height, gap))
    entry = Entry("", part, kind, width, height, gap=gap, seed=seed)
    if kind == "discs":
        number = round(float(rng.uniform(*_DISCS) * width * height / gap**2))
        least, most = (round(share * gap, 2) for share in _RADIUS)
        entry = replace(entry, discs=number, radius=(least, most))
    try:
        arena = entry.draw()
    except InvalidInput:
        return None
    return None if part == "train" and _has_too_much(arena) else replace(entry, sha256=digest(arena))


def _has_too_much(arena: Arena) -> bool:
    corners = max((len(polygon.vertices) for polygon in arena.polygons), default=0)
    return len(arena.discs) > MOST_DISCS or len(arena.polygons) > MOST_POLYGONS or corners > MOST_CORNERS


def write(path: Path) -> None:
    """The suite's file: an arena a line."""
    records = [{key: value for key, value in asdict(entry).items() if value is not None} for entry in entries()]
    lines = ",\n".join(json.dumps(record) for record in records)
    path.write_text(f'{{"suite": "suite-v1", "arenas": [\n{lines}\n]}}\n', encoding="utf-8")


if __name__ == "__main__":
    write(Path(__file__).with_name("suite-v1.json"))
