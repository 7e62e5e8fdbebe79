"""Games in several arenas: each is played in one of them, drawn at its start. One fixed arena takes none of this."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.errors import require
from apollonius.game.arena import Arena, Disc
from apollonius.game.polygon import Polygon

if TYPE_CHECKING:
    from apollonius.game.game import Game

_FAR = 1e6
"""Where what fills an empty place is [m], along x and y: so far away that it touches nothing."""


class Scenario(eqx.Module):
    """Arenas of one shape, each as likely as any other.

    Attributes:
        arenas: leaves `[members]`.
        size: how many they are.
    """

    arenas: Arena
    size: int = eqx.field(static=True)

    def sample(self, key: PRNGKeyArray) -> Int[Array, ""]:
        """The number of one of them. The key is consumed."""
        return jax.random.randint(key, (), 0, self.size)

    def arena(self, place: Int[Array, ""] | None) -> Arena:
        """The arena of this number, which the state of a game says."""
        assert place is not None, "a state of a game in one of several arenas says in which"
        return jax.tree.map(lambda leaf: leaf[place], self.arenas)


def in_arenas(game: "Game", arenas: Sequence[Arena]) -> "Game":
    """A game that is played in one of several arenas, drawn at each start; with one it is the game in that.

    All numbers of an arena are data, so that what is compiled serves them all; those with fewer obstacles than others
    are `padded`. `game.arena` is the first of them.

    Raises:
        InvalidInput: for no arena, for one that the game cannot be played in, and for arenas that do not go together:
            with maps, or with a territory in some of them only.
    """
    require(arenas, "arenas", "none", "one at least")
    first, *others = (replace(game, arena=arena, scenario=None) for arena in arenas)
    if not others:
        return first
    require(not any(arena.map for arena in arenas), "arenas", "with maps", "without, as maps have sizes of their own")
    discs = max(len(arena.discs) for arena in arenas)
    polygons = max(len(arena.polygons) for arena in arenas)
    corners = max((len(one.vertices) for arena in arenas for one in arena.polygons), default=0)
    alike = [padded(arena, discs, polygons, corners) for arena in arenas]
    shapes = {jax.tree.structure(arena) for arena in alike}
    require(len(shapes) == 1, "arenas", "of several kinds", "all with a territory or all without, and of one class")
    stacked = jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf, jnp.float32) for leaf in leaves]), *alike)
    return replace(first, scenario=Scenario(stacked, len(alike)))


def padded(arena: Arena, discs: int, polygons: int, corners: int) -> Arena:
    """The same arena with so many discs and polygons of so many corners each; what is missing is far from everywhere.

    Raises:
        InvalidInput: when it has more.
    """
    most = max((len(polygon.vertices) for polygon in arena.polygons), default=0)
    found = len(arena.discs), len(arena.polygons), most
    fits = all(number <= bound for number, bound in zip(found, (discs, polygons, corners), strict=True))
    require(fits, "discs, polygons, corners", found, f"at most {(discs, polygons, corners)}")
    nowhere = Polygon(((_FAR, _FAR),) * corners)
    filled = tuple(
        Polygon((*polygon.vertices, *[polygon.vertices[-1]] * (corners - len(polygon.vertices))))
        for polygon in arena.polygons
    )
    return replace(
        arena,
        discs=(*arena.discs, *[Disc(_FAR, _FAR, 0.0)] * (discs - len(arena.discs))),
        polygons=(*filled, *[nowhere] * (polygons - len(filled))),
    )
