"""Random arenas of several kinds, in which every robot thinner than the gap can go everywhere."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from apollonius.arenas.names import KINDS
from apollonius.arenas.random.buildings import buildings
from apollonius.arenas.random.caves import caves
from apollonius.arenas.random.detours import fences, floors
from apollonius.arenas.random.scattered import Layout, blocks, discs
from apollonius.arenas.random.walled import labyrinth, maze, racks, rooms
from apollonius.game.arena import MOST_POLYGONS, Arena
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap
from apollonius.io.errors import require
from apollonius.io.limits import SEED

_DRAW: dict[str, Callable[[Layout, np.random.Generator], Arena]] = dict(
    zip(
        KINDS,
        (discs, blocks, rooms, maze, racks, caves, labyrinth, fences, floors, buildings),
        strict=True,
    )
)
_LARGEST = 100.0
"""Longest side of a random arena [m]."""
_DRAWN = re.compile(
    r"(\w{1,20}) seed=(\d{1,10}) gap=([\d.e+-]{1,30}) "
    r"width=([\d.e+-]{1,30}) height=([\d.e+-]{1,30})",
    re.A,
)
"""Name of a random map."""


def random_arena(
    kind: str, seed: int, *, gap: float = 1.0, width: float = 10.0, height: float = 10.0
) -> Arena:
    """Draw a random arena; the `file` of its map is a name for `random_map`.

    Args:
        kind: one of `KINDS`.
        seed: the same seed draws the same arena.
        gap: least width of passages [m].
        width, height: the arena's size [m].

    Raises:
        InvalidInput: for impossible numbers, and where obstacles do not fit.
    """
    require(kind in KINDS, "kind", kind, f"one of {', '.join(KINDS)}")
    SEED.require("seed", seed)
    require(0 < gap < _LARGEST, "gap", gap, f"more than 0 and less than {_LARGEST:g} m")
    sides = (float(width), float(height))
    require(
        0 < min(sides) <= max(sides) <= _LARGEST,
        "width, height",
        sides,
        f"more than 0 and at most {_LARGEST:g} m",
    )
    arena = _DRAW[kind](Layout(*sides, gap), np.random.default_rng(seed))
    bound = f"a game has at most {MOST_POLYGONS} polygons, and this one more"
    remedy = f"wider, or the arena smaller: {bound}"
    require(len(arena.polygons) <= MOST_POLYGONS, "gap", gap, remedy)
    if arena.map:
        name = f"{kind} seed={seed} gap={float(gap)!r} width={sides[0]!r} height={sides[1]!r}"
        arena = replace(arena, map=replace(arena.map, file=name))
    return arena


def is_random_map(name: str) -> bool:
    """Check whether a name is of a random map, not of a file."""
    return bool(_DRAWN.fullmatch(name))


def random_map(name: str, digest: str | None = None) -> OccupancyMap:
    """Draw the map of a random arena again, from its name, which holds everything: a replay needs
    no other file.

    Raises InvalidInput for another name, one that draws no map, and another digest.
    """
    match = _DRAWN.fullmatch(name)
    kind, seed, *sizes = match.groups() if match else ("", "0")
    try:
        gap, width, height = map(float, sizes)
    except ValueError:
        gap = width = height = 0.0
    require(
        gap and kind in KINDS, "map", name, "as in 'caves seed=0 gap=1.0 width=10.0 height=10.0'"
    )
    cells = random_arena(kind, int(seed), gap=gap, width=width, height=height).map
    require(cells, "map", name, "of a kind that draws cells, as caves")
    assert cells
    bound = "the map of this game, which this version draws otherwise"
    require(
        digest in (None, cells.digest),
        f"map '{name}'",
        f"SHA-256 {cells.digest[:12]}...",
        f"{bound}; play it with the version that recorded it",
    )
    return cells


def with_random_arena(
    game: Game, kind: str, seed: int, gap: float, size: tuple[float, float]
) -> Game:
    """Return a game in one random arena in which both of its robots can go everywhere.

    Args:
        game: the game.
        kind, seed: as in `random_arena`.
        gap: least width of passages [m]; both robots must fit through.
        size: width and height of the arena [m].

    Raises:
        InvalidInput: as `random_arena`, and for a gap through which a robot does not fit.
    """
    alike = game.scenario is None or game.scenario.kinds is None
    require(
        alike, "game", "of robots of several kinds", "one that says which robots play in the arena"
    )
    for name, body in (("pursuer", game.pursuer), ("evader", game.evader)):
        bound = f"more than 2 {name}.radius = {2 * body.radius:g} m, or it does not fit through"
        require(gap > 2 * body.radius, "gap", gap, bound)
    width, height = size
    arena = random_arena(kind, seed, gap=gap, width=width, height=height)
    return game.in_arena(arena)
