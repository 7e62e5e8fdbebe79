"""Polygonal obstacles: how far away they are, and how near a straight step comes to them."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from apollonius.game.segment import closest_approach_squared
from apollonius.game.types import Real, RobotState, Scalar

PASSED_THROUGH = -1e-6
"""The clearance [m] of a step that goes in and out again: less than nothing, as it is for any other contact."""


class Polygon(eqx.Module):
    """An obstacle with straight edges, convex or not, that do not cross. Only the number of corners is static.

    Attributes:
        vertices: the corners x, y [m], either way round; the last is joined to the first.
    """

    vertices: tuple[tuple[Real, Real], ...]


class Edge(eqx.Module):
    """From a corner (x, y) [m] along to the next; `turn` is 1 where the polygon is counter-clockwise, else -1."""

    x: Scalar
    y: Scalar
    along_x: Scalar
    along_y: Scalar
    turn: Int[Array, ""]

    def left(self, x: Scalar, y: Scalar) -> Scalar:
        """How far a point is to the left of the edge's line, times the edge's length [m^2]."""
        return self.along_x * (y - self.y) - self.along_y * (x - self.x)

    def windings(self, x: Scalar, y: Scalar) -> Int[Array, ""]:
        """1 or -1 where a ray from a point along x crosses the edge: over all edges, how many polygons enclose it."""
        begins_above, ends_above = self.y > y, self.y + self.along_y > y
        crosses = (begins_above != ends_above) & ((self.left(x, y) > 0) == ends_above)
        return jnp.where(crosses, jnp.where(ends_above, self.turn, -self.turn), 0)

    def is_crossed(self, before: RobotState, after: RobotState) -> Bool[Array, ""]:
        """Whether the ends of the edge, and those of a step, lie on different sides of the other."""
        dx, dy = after.x - before.x, after.y - before.y
        x, y = self.x - before.x, self.y - before.y
        sides = (dx * y - dy * x) * (dx * (y + self.along_y) - dy * (x + self.along_x))
        return (self.left(before.x, before.y) * self.left(after.x, after.y) < 0) & (sides < 0)


class Place(eqx.Module):
    """A point among the edges that were looked at so far.

    Attributes:
        x, y: where it is [m].
        squared: distance from the nearest of them, squared [m^2].
        windings: how often they go round it.
    """

    x: Scalar
    y: Scalar
    squared: Scalar
    windings: Int[Array, ""]

    def beside(self, edge: Edge) -> "Place":
        """The same, with one more edge."""
        squared = closest_approach_squared(edge.x - self.x, edge.y - self.y, edge.along_x, edge.along_y)
        windings = self.windings + edge.windings(self.x, self.y)
        return Place(self.x, self.y, jnp.minimum(self.squared, squared), windings)

    @property
    def clearance(self) -> Scalar:
        """Distance [m] from the nearest edge; negative inside."""
        distance = jnp.sqrt(self.squared)
        return jnp.where(self.windings > 0, -distance, distance)


def clearance_from(polygons: Sequence[Polygon], x: Scalar, y: Scalar) -> Scalar:
    """Distance [m] from a point to the nearest edge; negative inside a polygon."""
    place, _ = jax.lax.scan(lambda place, edge: (place.beside(edge), None), _nowhere(x, y), edges_of(polygons))
    return place.clearance


def clearance_along(polygons: Sequence[Polygon], before: RobotState, after: RobotState) -> Scalar:
    """Least clearance [m] on the segment between two states.

    Outside it is exact: the least distance of any point of the segment from any edge. Of a segment that touches the
    inside it is negative: the clearance of the deeper end, or `PASSED_THROUGH` where both ends are outside.
    """
    dx, dy = after.x - before.x, after.y - before.y

    def look(seen: tuple[Place, Place, Scalar], edge: Edge) -> tuple[tuple[Place, Place, Scalar], None]:
        start, end, between = seen
        corner = closest_approach_squared(before.x - edge.x, before.y - edge.y, dx, dy)
        here = jnp.where(edge.is_crossed(before, after), PASSED_THROUGH, jnp.sqrt(corner))
        return (start.beside(edge), end.beside(edge), jnp.minimum(between, here)), None

    nothing = (_nowhere(before.x, before.y), _nowhere(after.x, after.y), jnp.asarray(jnp.inf, jnp.float32))
    (start, end, between), _ = jax.lax.scan(look, nothing, edges_of(polygons))
    return jnp.minimum(jnp.minimum(start.clearance, end.clearance), between)


def edges_of(polygons: Sequence[Polygon]) -> Edge:
    """The edges of all polygons, leaves `[edges]`. One after another they take the least arithmetic for a batch."""

    def edges(polygon: Polygon) -> Edge:
        corners = jnp.stack([jnp.stack([jnp.asarray(one, jnp.float32) for one in place]) for place in polygon.vertices])
        (x, y), (next_x, next_y) = corners.T, jnp.roll(corners, -1, axis=0).T
        turn = jnp.where(jnp.sum(x * next_y - next_x * y) > 0, 1, -1)
        return jax.vmap(Edge)(x, y, next_x - x, next_y - y, jnp.full(x.shape, turn))

    return jax.tree.map(lambda *parts: jnp.concatenate(parts), *[edges(polygon) for polygon in polygons])


def _nowhere(x: Scalar, y: Scalar) -> Place:
    return Place(x, y, jnp.asarray(jnp.inf, jnp.float32), jnp.zeros((), jnp.int32))
