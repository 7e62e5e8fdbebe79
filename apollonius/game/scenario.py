"""Games in several arenas: each is played in one of them, drawn at its start. One fixed arena takes none of this."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.polygon import Polygon
from apollonius.game.types import Role
from apollonius.io.errors import require

if TYPE_CHECKING:
    from apollonius.game.game import Game

_STRIDE = 7
"""By how many makes two arenas next to each other differ in a match."""
_FAR = 1e6
"""Where what fills an empty place is [m], along x and y: so far away that it touches nothing."""


class Makes(eqx.Module):
    """Pairs of robots of several makes, leaves `[makes]`.

    Attributes:
        pursuer, evader: their limits.
        capture_distance: how near to each other they are when one is caught [m].
    """

    pursuer: Unicycle
    evader: Unicycle
    capture_distance: Float[Array, " makes"]

    def __len__(self) -> int:
        return len(self.capture_distance)

    def every(self, role: Role) -> list[Unicycle]:
        """The robots of one side, one by one, in plain numbers."""
        bodies = self.evader if role == Role.EVADER else self.pursuer
        return [jax.tree.map(lambda leaf, one=one: float(leaf[one]), bodies) for one in range(len(self))]


class Scenario(eqx.Module):
    """Arenas of one shape, each as likely as any other, and maybe robots of several makes, each as likely too.

    Attributes:
        arenas: leaves `[arenas]`.
        count: how many they are.
        makes: the robots, all of a side alike; None for those of the game everywhere.
        name: of the file that says which they are, or empty.
    """

    arenas: Arena
    count: int = eqx.field(static=True)
    makes: Makes | None = None
    name: str = eqx.field(static=True, default="")

    @property
    def size(self) -> int:
        """How many places there are: every arena with every make of robots."""
        return self.count * (len(self.makes) if self.makes else 1)

    def sample(self, key: PRNGKeyArray) -> Int[Array, ""]:
        """The number of one of them. The key is consumed."""
        return jax.random.randint(key, (), 0, self.size)

    def place_of(self, index: Any) -> Any:
        """The number of the one in which a match has its game of this index: all arenas take turns, all makes too."""
        arena, turn = index % self.count, index // self.count
        return arena if self.makes is None else arena + self.count * ((turn + _STRIDE * arena) % len(self.makes))

    def arena(self, place: Int[Array, ""]) -> Arena:
        """The arena of this place, which the state of a game says. Its chart stays with those of the others, as it is
        too large to be copied for each game.
        """
        number = place % self.count
        arena = jax.tree.map(lambda leaf: leaf[number], replace(self.arenas, chart=None))
        chart = self.arenas.chart
        return arena if chart is None else replace(arena, chart=replace(chart, member=number))

    def game(self, game: "Game", place: Int[Array, ""] | None) -> "Game":
        """The game in one arena that is played at this place."""
        assert place is not None, "a state of a game in one of several arenas says in which"
        alone = replace(game, arena=self.arena(place), scenario=None)
        if self.makes is None:
            return alone
        make = jax.tree.map(lambda leaf: leaf[place // self.count], self.makes)
        others = game.teams and replace(
            game.teams,
            pursuers=(make.pursuer,) * len(game.teams.pursuers),
            evaders=(make.evader,) * len(game.teams.evaders),
        )
        return replace(
            alone, pursuer=make.pursuer, evader=make.evader, capture_distance=make.capture_distance, teams=others
        )


def in_arenas(game: "Game", arenas: Sequence[Arena], makes: Makes | None = None) -> "Game":
    """A game that is played in one of several arenas, drawn at each start; with one it is the game in that.

    All numbers of an arena are data, so that what is compiled serves them all. `game.arena` is the first of them.

    Args:
        makes: robots of several makes, of which a pair is drawn too; None for those of the game.

    Raises:
        InvalidInput: for no arena, for one that the game cannot be played in, and for arenas that do not go together:
            with a territory in some of them only.
    """
    require(arenas, "arenas", "none", "one at least")
    first, *others = (replace(game, arena=arena, scenario=None) for arena in arenas)
    if not others and makes is None:
        return first
    return replace(first, scenario=Scenario(together(arenas), len(arenas), makes))


def together(arenas: Sequence[Arena]) -> Arena:
    """Arenas of one shape, leaves `[arenas]`: those with fewer obstacles or smaller maps than others are `padded`.

    Raises:
        InvalidInput: for arenas that do not go together, as `in_arenas`.
    """
    maps = [arena.map.field.shape for arena in arenas if arena.map]
    corners_of_map = tuple(np.max(maps, axis=0).tolist()) if maps else None
    discs = max(len(arena.discs) for arena in arenas)
    polygons = max(len(arena.polygons) for arena in arenas)
    corners = max((len(one.vertices) for arena in arenas for one in arena.polygons), default=0)
    alike = [padded(arena, discs, polygons, corners, corners_of_map) for arena in arenas]
    shapes = {jax.tree.structure(arena) for arena in alike}
    require(len(shapes) == 1, "arenas", "of several kinds", "all with a territory or all without, and of one class")
    packed = [replace(arena, polygons=tuple(map(_packed, arena.polygons))) for arena in alike]
    return jax.tree.map(lambda *leaves: jnp.asarray(np.array(leaves, np.float32)), *packed)


def _packed(polygon: Polygon) -> Polygon:
    """Return the polygon with its corners in one array: compiling takes time for every number that is passed alone."""
    return Polygon(jnp.asarray(np.asarray(polygon.vertices, np.float32)))


def padded(
    arena: Arena, discs: int, polygons: int, corners: int, corners_of_map: tuple[int, int] | None = None
) -> Arena:
    """The same arena with so many discs and polygons of so many corners each; what is missing is far from everywhere.

    Args:
        corners_of_map: rows and columns of its map's field, which goes on as it ends; the map is then of no file. One
            without a map has one that is free everywhere. None for arenas without maps.

    Raises:
        InvalidInput: when it has more.
    """
    most = max((len(polygon.vertices) for polygon in arena.polygons), default=0)
    found = len(arena.discs), len(arena.polygons), most
    fits = all(number <= bound for number, bound in zip(found, (discs, polygons, corners), strict=True))
    require(fits, "discs, polygons, corners", found, f"at most {(discs, polygons, corners)}")
    nowhere = Polygon(((_FAR, _FAR),) * corners)
    filled = tuple(
        Polygon((*outline, *[outline[-1]] * (corners - len(outline))))
        for outline in (polygon.outline() for polygon in arena.polygons)
    )
    return replace(
        arena,
        discs=(*arena.discs, *[Disc(_FAR, _FAR, 0.0)] * (discs - len(arena.discs))),
        polygons=(*filled, *[nowhere] * (polygons - len(filled))),
        map=corners_of_map and _padded_map(arena.map, corners_of_map),
    )


def _padded_map(found: OccupancyMap | None, corners: tuple[int, int]) -> OccupancyMap:
    if found is None:
        return OccupancyMap(jnp.full(corners, _FAR, jnp.float32), 0.0, 0.0, 1.0, "", "")
    missing = [(0, wanted - there) for wanted, there in zip(corners, found.field.shape, strict=True)]
    # In NumPy, as JAX would compile it for every shape.
    return replace(found, field=jnp.asarray(np.pad(found.field, missing, mode="edge")), file="", digest="")
