"""Scenarios: several arenas, and maybe several kinds of robots, from which each game draws one at
its start.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from apollonius.game.arena import Arena
from apollonius.game.contact import ContactBounds
from apollonius.game.drive import Drives
from apollonius.game.dynamics import Unicycle
from apollonius.game.occupancy import OccupancyMap, OneOfMaps
from apollonius.game.packed_arena import PackedArena, contact_bounds, packed_arena, without_shapes
from apollonius.game.polygon import Edge
from apollonius.game.sensing import Sensing
from apollonius.game.types import Real, Role
from apollonius.game.validation import check_parts
from apollonius.io.errors import require

_STRIDE = 7
"""Kinds of robots by which two neighbouring arenas differ in a match."""
_WHOLE = "delay", "lag"
"""Numbers that are whole."""
_FAR = 1e6
"""Coordinates of padding [m]: so far away that it touches nothing."""


@dataclass(frozen=True)
class Spread:
    """Numbers that each game draws, each apart: uniform, of whole ones both ends included.

    Attributes:
        fields: their dotted paths in a game, as `pursuer.v_max` or `sensors.pursuer.noise.heading`.
        low, high: least and largest value.
    """

    fields: tuple[str, ...]
    low: float
    high: float

    def __post_init__(self) -> None:
        require(
            self.low <= self.high,
            f"{', '.join(self.fields)}: low",
            self.low,
            f"at most high = {self.high}",
        )


class RobotKinds(eqx.Module):
    """Pairs of robots of several kinds, leaves `[kinds]`, with the capture distance of each [m].

    Sensors and drives are those of the game where they are None.
    """

    pursuer: Unicycle
    evader: Unicycle
    capture_distance: Float[Array, " kinds"]
    sensors: Sensing | None = None
    drives: Drives | None = None

    def __len__(self) -> int:
        return len(self.capture_distance)

    def every(self, role: Role) -> list[Unicycle]:
        """Return the robots of one side in plain numbers."""
        bodies = self.evader if role == Role.EVADER else self.pursuer
        numbers = range(len(self))
        return [jax.tree.map(lambda leaf, i=i: float(leaf[i]), bodies) for i in numbers]

    def spread(self, spreads: Sequence[Spread]) -> "RobotKinds":
        """Return kinds whose numbers of these fields are drawn, always the same ones; raises
        InvalidInput for a field that robots do not have, and for impossible values.
        """
        rng = np.random.default_rng(0)
        count = len(self)
        kinds = self
        for spread in spreads:
            for field in spread.fields:
                for end in (spread.low, spread.high):
                    single = _with(
                        RobotKinds(Unicycle(), Unicycle(), jnp.ones(1)),
                        field.split("."),
                        end,
                        field,
                    )
                    check_parts(single.sensors, single.drives)
                if field.rpartition(".")[2] in _WHOLE:
                    values = rng.integers(int(spread.low), int(spread.high) + 1, count)
                else:
                    values = rng.uniform(spread.low, spread.high, count)
                kinds = _with(kinds, field.split("."), jnp.asarray(values, jnp.float32), field)
        return jax.tree.map(
            lambda leaf: jnp.broadcast_to(jnp.asarray(leaf, jnp.float32), (count,)), kinds
        )


def _with(part: Any, path: Sequence[str], value: Real, field: str) -> Any:
    """Return a part of the kinds with a value at a path; parts on it that are None begin with their
    defaults.
    """
    name, *rest = path
    types: dict[str, Any] = {entry.name: entry.type for entry in fields(part)}
    require(name in types, "field", field, f"of the robots: '{name}' is none of {', '.join(types)}")
    candidates = types[name], *get_args(types[name])
    classes = [candidate for candidate in candidates if isinstance(candidate, type)]
    kinds = [candidate for candidate in classes if issubclass(candidate, eqx.Module)]
    require(bool(kinds) == bool(rest), "field", field, "the whole path of one number")
    if not rest:
        return replace(part, **{name: value})
    inner = getattr(part, name)
    if inner is None:
        inner = kinds[0]()
    return replace(part, **{name: _with(inner, rest, value, field)})


class Scenario(eqx.Module):
    """Arenas without discs and polygons, leaves `[arenas]`, all equally likely, these as `bounds`,
    and maybe robots of several kinds, all of a side alike, equally likely too; and its name in a
    game's file (`apollonius.arenas.suite`).
    """

    arenas: Arena
    count: int = eqx.field(static=True)
    bounds: ContactBounds | None = None
    kinds: RobotKinds | None = None
    name: str = eqx.field(static=True, default="")

    @property
    def size(self) -> int:
        """The number of variants: every arena with every kind of robots."""
        return self.count * (len(self.kinds) if self.kinds else 1)

    @property
    def edges(self) -> Edge | None:
        """The edges of all polygons, leaves `[arenas, edges]`; None without any."""
        edges = self.bounds and self.bounds.shapes.edges
        return edges and edges.edges

    def sample(self, key: PRNGKeyArray) -> Int[Array, ""]:
        """Draw a variant. The key is consumed."""
        return jax.random.randint(key, (), 0, self.size)

    def variant_of(self, index: Any) -> Any:
        """Return the variant of a match's game of this index: all arenas take turns, and all kinds
        of robots.
        """
        arena, turn = index % self.count, index // self.count
        if self.kinds is None:
            return arena
        return arena + self.count * ((turn + _STRIDE * arena) % len(self.kinds))

    @classmethod
    def of(
        cls, arenas: Sequence[Arena], kinds: RobotKinds | None = None, name: str = ""
    ) -> "Scenario":
        """Return the scenario of some arenas; raises InvalidInput unless they are alike."""
        return cls(_stack(arenas), len(arenas), contact_bounds(arenas), kinds, name)

    def each(self) -> list[PackedArena]:
        """Return every arena by itself."""

        def alone(number: int) -> PackedArena:
            arena, bounds = jax.tree.map(lambda leaf: leaf[number], self.arenas), self.bounds
            own_bounds = bounds and jax.tree.map(lambda leaf: leaf[number : number + 1], bounds)
            return packed_arena(arena, own_bounds, 0)

        return list(map(alone, range(self.count)))

    def arena(self, variant: Int[Array, ""]) -> PackedArena:
        """Return the arena of a variant. Discs, polygons and a map's field stay with all others:
        they are too large to copy.
        """
        number = variant % self.count
        cells = self.arenas.map

        def own(leaf: Any) -> Array:
            return jnp.take(leaf, number, 0, mode="clip")

        arena = jax.tree.map(own, replace(self.arenas, map=None))
        own_map = cells and OneOfMaps(
            cells.field, own(cells.x), own(cells.y), own(cells.cell), "", "", number
        )
        return packed_arena(replace(arena, map=own_map), self.bounds, number)


def _stack(arenas: Sequence[Arena]) -> Arena:
    """Return arenas without discs and polygons as one, leaves `[arenas]`; raises InvalidInput
    unless they are alike.

    A map's field gets as many rows and columns as any, and continues as it ends; an arena without a
    map, while others have one, gets one that is free everywhere.
    """
    maps = [arena.map.field.shape for arena in arenas if arena.map]
    corners_of_map = tuple(np.max(maps, axis=0).tolist()) if maps else None
    padded = [
        replace(
            without_shapes(arena), map=corners_of_map and _padded_map(arena.map, corners_of_map)
        )
        for arena in arenas
    ]
    shapes = set(map(jax.tree.structure, padded))
    require(
        len(shapes) == 1, "arenas", "of several kinds", "alike but for discs, polygons and maps"
    )
    return jax.tree.map(lambda *leaves: jnp.asarray(np.array(leaves, np.float32)), *padded)


def _padded_map(occupancy: OccupancyMap | None, corners: tuple[int, int]) -> OccupancyMap:
    if occupancy is None:
        return OccupancyMap(jnp.full(corners, _FAR, jnp.float32), 0.0, 0.0, 1.0, "", "")
    sizes = zip(corners, occupancy.field.shape, strict=True)
    padding = [(0, size - current) for size, current in sizes]
    # In NumPy, as JAX would compile it for every shape.
    return replace(
        occupancy,
        field=jnp.asarray(np.pad(occupancy.field, padding, mode="edge")),
        file="",
        digest="",
    )
