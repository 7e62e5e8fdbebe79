"""The edges of polygons in several arenas, of which a step looks only at those near it."""

from collections.abc import Callable
from functools import partial
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from apollonius.accelerate.nearby import NearbyIndex, index_nearby
from apollonius.game.obstacle import Walls
from apollonius.game.polygon import Edge, Edges, PointToEdges, far_from_edges
from apollonius.game.types import Flag, RobotState, Scalar

T = TypeVar("T")
_FAR = 1e6
"""Coordinates of padding [m]: so far away that it touches nothing."""
_JOINED = 1e-3
"""Distance [m] below which two corners are one, many times the rounding of single precision."""


class NearEdges(Edges):
    """The edges of polygons in several arenas, leaves `[edges]`, as the obstacle that those of one
    arena are.

    Clearances are cut off at a reach, beyond which edges are not looked at.

    Attributes:
        index: by arena, the numbers of all edges of the polygons within reach.
        reach: the reach [m].
        member: the number of the arena.
    """

    index: NearbyIndex
    reach: Scalar
    member: Int[Array, ""] | int = 0

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Return the distance [m] from a point to the nearest edge; negative inside a polygon."""
        return jnp.minimum(self._near(x, y).clearance(x, y), self.reach)

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Return the least clearance [m] on the segment between two states; it is cut off at the
        reach less half of the segment.
        """
        near = self._near((before.x + after.x) / 2, (before.y + after.y) / 2)
        half = jnp.hypot(after.x - before.x, after.y - before.y) / 2
        return jnp.minimum(near.clearance_along(before, after), self.reach - half)

    def _near(self, x: Scalar, y: Scalar) -> Edges:
        return _Listed(self.edges, self.index.near(self.member, x, y))


class _Listed(Edges):
    """Some of the edges, by their numbers."""

    numbers: Int[Array, " some"]

    def _over_edges(self, add_edge: Callable[[T, Edge], T], initial: T) -> T:
        # One by one: copies of all of them, for each step of a batch, would take longer.
        def one_edge(value: T, number: Int[Array, ""]) -> tuple[T, None]:
            return add_edge(value, jax.tree.map(lambda leaf: leaf[number], self.edges)), None

        end, _ = jax.lax.scan(one_edge, initial, self.numbers)
        return end


def near_edges(edges: Edge, walls: Walls, reach: float) -> NearEdges:
    """Index edges by the cells of their arenas.

    Args:
        edges: of the polygons in each arena, leaves `[arenas, edges]`.
        walls: of the arenas, leaves `[arenas]`, or the numbers of one arena.
        reach: distance [m] up to which a polygon counts as near.
    """
    x, y, x_max, y_max = (
        np.ravel(np.asarray(end, float))
        for end in (walls.x_min, walls.y_min, walls.x_max, walls.y_max)
    )
    # An edge begins where the one before ends, or a polygon; two that meet there count as one.
    starts, along = jnp.stack([edges.x, edges.y]), jnp.stack([edges.along_x, edges.along_y])
    gaps = jnp.abs(starts[..., 1:] - (starts + along)[..., :-1]).max(axis=0)
    is_first = jnp.pad(gaps > _JOINED, ((0, 0), (1, 0)), constant_values=True)

    def distances(
        arena: int, x: Float[Array, " columns"], y: Float[Array, " rows"]
    ) -> Float[np.ndarray, "edges rows columns"]:
        own_edges = jax.tree.map(lambda leaf: leaf[arena], edges)
        so_far = np.asarray(_clearances_so_far(own_edges, is_first[arena], x, y))
        first = np.flatnonzero(is_first[arena])
        last = np.append(first[1:], len(so_far)) - 1
        return np.repeat(so_far[last], 1 + last - first, axis=0)

    index = index_nearby(distances, reach, x, y, np.maximum(x_max - x, y_max - y))
    far, zero = jnp.float32(_FAR), jnp.float32(0)
    flat = jax.tree.map(jnp.append, edges, Edge(far, far, zero, zero, jnp.int32(1)))
    return NearEdges(flat, index, jnp.float32(reach))


@jax.jit
def _clearances_so_far(
    edges: Edge,
    is_first: Bool[Array, " edges"],
    x: Float[Array, " columns"],
    y: Float[Array, " rows"],
) -> Float[Array, "edges rows columns"]:
    """Return clearances from each edge and the ones before it of the same polygon."""
    nothing = jax.vmap(jax.vmap(far_from_edges, (0, None)), (None, 0))(x, y)

    def one_edge(
        places: PointToEdges, next_edge: tuple[Edge, Flag]
    ) -> tuple[PointToEdges, Float[Array, "rows columns"]]:
        edge, is_first = next_edge
        places = jax.tree.map(partial(jnp.where, is_first), nothing, places)
        places = jax.vmap(jax.vmap(lambda place: place.with_edge(edge)))(places)
        return places, jax.vmap(jax.vmap(lambda place: place.clearance))(places)

    return jax.lax.scan(one_edge, nothing, (edges, is_first))[1]
