"""Random arenas of several kinds, in which every robot that fits through the gaps can go everywhere."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from apollonius.arenas.random.caves import caves
from apollonius.arenas.random.scattered import Layout, blocks, discs
from apollonius.arenas.random.walled import maze, racks, rooms
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.validation import MOST_POLYGONS
from apollonius.io.errors import require
from apollonius.io.limits import SEED

KINDS: dict[str, Callable[[Layout, np.random.Generator], Arena]] = {
    "discs": discs,
    "blocks": blocks,
    "rooms": rooms,
    "maze": maze,
    "racks": racks,
    "caves": caves,
}
"""All kinds, by name. Another is a file of its own and its name here."""
_LARGEST = 100.0
"""Longest side of a random arena [m]."""
_DRAWN = re.compile(
    r"(\w{1,20}) seed=(\d{1,10}) gap=([\d.e+-]{1,30}) width=([\d.e+-]{1,30}) height=([\d.e+-]{1,30})", re.A
)
"""How a map that was drawn at random is called."""


def random_arena(
    kind: str, seed: int, *, gap: float = 1.0, width: float = 10.0, height: float = 10.0, **numbers: object
) -> Arena:
    """An arena of one kind: one seed, one arena.

    Args:
        kind: one of `KINDS`.
        seed: of the random numbers.
        gap: least width of all passages [m]; whatever is thinner can go everywhere.
        width, height: of the arena [m].
        numbers: those that the kind has besides: of `discs` their `count` and `radius`.

    Returns:
        The arena. A map in it has no file: its `file` says by what it was drawn, and `random_map` draws it again.

    Raises:
        InvalidInput: for an unknown kind, impossible numbers, and where nothing finds room.
    """
    require(kind in KINDS, "kind", kind, f"one of {', '.join(KINDS)}")
    SEED.require("seed", seed)
    require(0 < gap < _LARGEST, "gap", gap, f"more than 0 and less than {_LARGEST:g} m")
    sides = (float(width), float(height))
    require(0 < min(sides) <= max(sides) <= _LARGEST, "width, height", sides, f"more than 0 and at most {_LARGEST:g} m")
    arena = partial(KINDS[kind], **numbers)(Layout(*sides, gap), np.random.default_rng(seed))
    bound = f"wider, or the arena smaller: a game has at most {MOST_POLYGONS} polygons, and this one more"
    require(len(arena.polygons) <= MOST_POLYGONS, "gap", gap, bound)
    if arena.map:
        name = f"{kind} seed={seed} gap={float(gap)!r} width={sides[0]!r} height={sides[1]!r}"
        arena = replace(arena, map=replace(arena.map, file=name))
    return arena


def is_drawn(name: str) -> bool:
    """Whether a map is called as `random_arena` calls those it draws, and no file is."""
    return bool(_DRAWN.fullmatch(name))


def random_map(name: str, digest: str | None = None) -> OccupancyMap:
    """The map of a random arena again, from its name.

    All that a map was drawn by is in its name, and not where it is written down: so a game on it can be recorded
    wherever it is played, in a replay or an agent's file, and needs no other file to be played again.

    Args:
        name: `file` of the map.
        digest: what the map must have; None for any.

    Raises:
        InvalidInput: for another name, for one that draws no map, as `random_arena`, and for another digest.
    """
    found = _DRAWN.fullmatch(name)
    kind, seed, *sizes = found.groups() if found else ("", "0")
    try:
        gap, width, height = map(float, sizes)
    except ValueError:
        gap = width = height = 0.0
    require(gap and kind in KINDS, "map", name, "as in 'caves seed=0 gap=1.0 width=10.0 height=10.0'")
    drawn = random_arena(kind, int(seed), gap=gap, width=width, height=height).map
    require(drawn, "map", name, "of a kind that draws cells, as caves")
    assert drawn
    bound = "the map of this game, which this version draws otherwise; play it with the version that recorded it"
    require(digest in (None, drawn.digest), f"map '{name}'", f"SHA-256 {drawn.digest[:12]}...", bound)
    return drawn


def in_random_arena(game: Game, kind: str, seed: int, gap: float, size: tuple[float, float], **numbers: object) -> Game:
    """Return a game in one random arena of a width and height [m] in which both of its robots can go everywhere.

    Arguments and errors are those of `random_arena`; the gap must also let the robots through, and these must be of
    one make.
    """
    alike = game.scenario is None or game.scenario.makes is None
    require(alike, "game", "of robots of several makes", "one that says which robots play in the arena")
    for name, body in (("pursuer", game.pursuer), ("evader", game.evader)):
        bound = f"more than 2 {name}.radius = {2 * body.radius:g} m, or it does not fit through"
        require(gap > 2 * body.radius, "gap", gap, bound)
    width, height = size
    arena = random_arena(kind, seed, gap=gap, width=width, height=height, **numbers)
    return replace(game, arena=arena, scenario=None)
