"""Arenas whose discs and polygons are in arrays: one program plays in many, and computes contact
only near obstacles.
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from apollonius.game.arena import Arena, Disc
from apollonius.game.contact import ContactBounds, Shapes
from apollonius.game.obstacle import AbstractObstacle
from apollonius.game.polygon import Edge, Edges, Polygon
from apollonius.game.types import Flag, Real, RobotState, Scalar

_FAR = 1e6
_FAR_DISC, _FAR_EDGE = (_FAR, _FAR, 0.0), (_FAR, _FAR, 0.0, 0.0, 1.0)
"""Padding, so far away that it touches nothing."""
_MANY = 16
"""Discs from which on an arena without polygons is packed."""
LENGTHS = 64, 256, 1024, 2048
"""Lengths of the lists of an arena alone."""


class PackedArena(Arena):
    """One of several arenas, whose discs and polygons are not in its lists but in `bounds`."""

    bounds: ContactBounds | None = None
    member: Int[Array, ""] | int = 0

    @property
    def _merged(self) -> list[AbstractObstacle]:
        obstacles = super()._merged
        if self.bounds is None:
            return obstacles
        return [*obstacles, self.bounds.shapes_of(self.member)]

    def hits_obstacle(self, before: RobotState, after: RobotState, radius: Real) -> Flag:
        """Check whether a body of this radius [m] touches an obstacle anywhere along a straight
        step.
        """
        is_hit = self._without_shapes.hits_obstacle(before, after, radius)
        if self.bounds is None:
            return is_hit
        return is_hit | self.bounds.is_hit(jnp.asarray(self.member), before, after, radius)

    def is_clear(self, x: Scalar, y: Scalar, distance: Real, matters: Flag | bool = True) -> Flag:
        """Check whether walls and obstacles are at least a distance [m] away from a point; where it
        does not matter, the answer may be wrong.
        """
        is_clear = self._without_shapes.is_clear(x, y, distance)
        if self.bounds is None:
            return is_clear
        member = jnp.asarray(self.member)
        return is_clear & self.bounds.is_clear(member, x, y, distance, is_clear & matters)

    @property
    def _without_shapes(self) -> Arena:
        walls = self.x_min, self.x_max, self.y_min, self.y_max
        return Arena(*walls, map=self.map, extra=self.extra)


def pack(arena: Arena) -> Arena:
    """Return an arena alone with its discs and polygons in arrays of lengths that many arenas
    share; itself with a few discs, and where numbers are swept.
    """
    shapes = (arena.discs, arena.polygons)
    is_swept = any(not isinstance(leaf, (int, float)) for leaf in jax.tree.leaves(shapes))
    if is_swept or (not arena.polygons and len(arena.discs) < _MANY):
        return arena
    return packed_arena(without_shapes(arena), contact_bounds([arena], LENGTHS), 0)


def list_length(count: int, lengths: Sequence[int]) -> int:
    """Return the least of some lengths that suffices for a list."""
    return min(length for length in lengths if length >= count)


def packed_arena(
    arena: Arena, bounds: ContactBounds | None, member: Int[Array, ""] | int
) -> PackedArena:
    """Return an arena without discs and polygons, with those in the bounds."""
    parts: dict[str, Any] = {part.name: getattr(arena, part.name) for part in fields(Arena)}
    return PackedArena(**parts, bounds=bounds, member=member)


def without_shapes(arena: Arena) -> Arena:
    """Return an arena without its discs and polygons."""
    return replace(arena, discs=(), polygons=())


def contact_bounds(
    arenas: Sequence[Arena], lengths: Sequence[int] | None = None
) -> ContactBounds | None:
    """Return the discs and polygons of arenas, and the distances from them; None without any.

    All get lists as long as the longest, or of the least of these lengths that suffices; what is
    added is far from everywhere.
    """
    discs = _stack([_disc_numbers(arena.discs) for arena in arenas], _FAR_DISC, lengths)
    edges = stacked_edges(arenas, lengths)
    if discs is None and edges is None:
        return None
    shapes = Shapes(
        discs=None if discs is None else Disc(*discs), edges=None if edges is None else Edges(edges)
    )
    walls = [(arena.x_min, arena.y_min, arena.x_max, arena.y_max) for arena in arenas]
    return ContactBounds.of(shapes, *jnp.asarray(walls, jnp.float32).T)


def stacked_edges(arenas: Sequence[Arena], lengths: Sequence[int] | None = None) -> Edge | None:
    """Return the edges of the polygons of arenas, leaves `[arenas, edges]`, in lists of lengths as
    those of `contact_bounds`; None without any.
    """
    columns = _stack([_edge_numbers(arena.polygons) for arena in arenas], _FAR_EDGE, lengths)
    return None if columns is None else _edge(*columns)


def without_edges(arena: PackedArena) -> PackedArena:
    """Return a packed arena without the edges of its polygons."""
    if arena.bounds is None:
        return arena
    shapes = replace(arena.bounds.shapes, edges=None)
    return replace(arena, bounds=shapes.discs and replace(arena.bounds, shapes=shapes))


def _disc_numbers(discs: Sequence[Disc]) -> np.ndarray:
    """Return the fields of `Disc` for all discs, `[discs, 3]`."""
    return np.array([(disc.x, disc.y, disc.radius) for disc in discs], np.float32)


def _edge_numbers(polygons: Sequence[Polygon]) -> np.ndarray:
    """Return the fields of `Edge` for all edges of polygons, `[edges, 5]`."""
    edges = [np.zeros((0, 5), np.float32)]
    for polygon in polygons:
        corners = np.asarray(polygon.vertices, np.float32)
        following = np.roll(corners, -1, axis=0)
        (x, y), (next_x, next_y) = corners.T.astype(float), following.T.astype(float)
        turn = 1.0 if np.sum(x * next_y - next_x * y) > 0 else -1.0
        turns = np.full((len(corners), 1), turn, np.float32)
        edges.append(np.concatenate([corners, following - corners, turns], axis=1))
    return np.concatenate(edges)


@jax.vmap
@jax.vmap
def _edge(x: Scalar, y: Scalar, along_x: Scalar, along_y: Scalar, turn: Scalar) -> Edge:
    return Edge(x, y, along_x, along_y, turn.astype(jnp.int32))


def _stack(
    rows: Sequence[np.ndarray], padding: tuple[float, ...], lengths: Sequence[int] | None
) -> tuple[Array, ...] | None:
    """Return the columns of tables, padded to one length, `[tables, rows]`; None if that is 0."""
    count = max(map(len, rows))
    if lengths:
        count = list_length(count, lengths)
    if not count:
        return None
    padded = np.empty((len(rows), count, len(padding)), np.float32)
    padded[:] = padding
    for table, target in zip(rows, padded, strict=True):
        target[: len(table)] = table.reshape(-1, len(padding))
    return tuple(jnp.asarray(column) for column in np.moveaxis(padded, -1, 0))
