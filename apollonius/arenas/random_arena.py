"""Random arenas of several kinds, in which every robot that fits through the gaps can go everywhere."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from apollonius.arenas.random.blocks import blocks
from apollonius.arenas.random.discs import discs
from apollonius.arenas.random.layout import Layout
from apollonius.arenas.random.maze import maze
from apollonius.arenas.random.racks import racks
from apollonius.arenas.random.rooms import rooms
from apollonius.errors import require
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.validation import MOST_POLYGONS
from apollonius.limits import SEED

KINDS: dict[str, Callable[[Layout, np.random.Generator], Arena]] = {
    "discs": discs,
    "blocks": blocks,
    "rooms": rooms,
    "maze": maze,
    "racks": racks,
}
"""All kinds, by name. Another is a file of its own and its name here."""
_LARGEST = 100.0
"""Longest side of a random arena [m]."""


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
    return arena


def in_random_arena(game: Game, kind: str, seed: int, gap: float, size: tuple[float, float], **numbers: object) -> Game:
    """A game in a random arena of a width and height [m] in which both of its robots can go everywhere.

    Arguments and errors are those of `random_arena`; the gap must also let the robots through.
    """
    for name, body in (("pursuer", game.pursuer), ("evader", game.evader)):
        bound = f"more than 2 {name}.radius = {2 * body.radius:g} m, or it does not fit through"
        require(gap > 2 * body.radius, "gap", gap, bound)
    width, height = size
    return replace(game, arena=random_arena(kind, seed, gap=gap, width=width, height=height, **numbers))
