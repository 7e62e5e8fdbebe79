"""Polygonal obstacles: distances from them, and contact with them along a step."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from apollonius.game.obstacle import AbstractObstacle, Corners, Walls, closest_approach_squared
from apollonius.game.types import Flag, Real, RobotState, Scalar
from apollonius.io.errors import require

T = TypeVar("T")
MOST_CORNERS = 1_000
"""Most corners of a polygon: every step looks at them all."""
_APART = 1e-6
"""Distances below this [m] count as contact: single precision resolves no less in an arena some
metres wide.
"""
_PASSED_THROUGH = -1e-6
"""The clearance [m] of a step that goes in and out again: less than nothing, as it is for any other
contact.
"""


class Polygon(AbstractObstacle):
    """An obstacle with straight edges, convex or not, that do not cross. Only the number of corners
    is static.

    Attributes:
        vertices: the corners x, y [m], either way round; the last is joined to the first. One
            array, rather than a number each, where many arenas are compiled together.
    """

    vertices: tuple[tuple[Real, Real], ...] | Float[Array, "*arenas corners 2"]

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Return the distance [m] from a point to the nearest edge; negative inside."""
        return Edges.of((self,)).clearance(x, y)

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Return the least clearance [m] on the segment between two states, as `Edges` does."""
        return Edges.of((self,)).clearance_along(before, after)

    def outline(self) -> Corners:
        """Return the corners."""
        return tuple((x, y) for x, y in self.vertices)

    def check(self, name: str, walls: Walls) -> None:
        """Refuse corners outside the walls, and edges that meet elsewhere than at the corners they
        share.
        """
        name = f"{name}.vertices"
        corners = np.asarray(self.vertices, float).reshape(-1, 2)
        count = len(corners)
        bound = f"3 to {MOST_CORNERS}; give [x, y] of each, in order"
        require(3 <= count <= MOST_CORNERS, name, f"{count} corners", bound)
        low = np.array([walls.x_min, walls.y_min])
        high = np.array([walls.x_max, walls.y_max])
        outside = np.flatnonzero(~((corners >= low) & (corners <= high)).all(axis=1))
        beyond = f"inside the walls {walls.sides}; move them"
        require(not len(outside), name, f"{_places(corners, outside)} and others", beyond)
        meeting = _crossing_edges(corners)
        order = "the corners in order around it, each once, whose edges meet nowhere else"
        require(
            not len(meeting),
            name,
            f"{_places(corners, meeting)} and others",
            f"{order}; those from these places do",
        )


class Edge(eqx.Module):
    """An edge from a corner (x, y) [m] to the next; `turn` is 1 where the polygon is
    counter-clockwise, else -1.
    """

    x: Scalar
    y: Scalar
    along_x: Scalar
    along_y: Scalar
    turn: Int[Array, ""]

    def left(self, x: Scalar, y: Scalar) -> Scalar:
        """Return a point's distance to the left of the edge's line, times its length [m^2]."""
        return self.along_x * (y - self.y) - self.along_y * (x - self.x)

    def windings(self, x: Scalar, y: Scalar) -> Int[Array, ""]:
        """Return 1 or -1 where a ray from a point along x crosses the edge, else 0.

        The sum over all edges is the number of polygons around the point.
        """
        begins_above, ends_above = self.y > y, self.y + self.along_y > y
        crosses = (begins_above != ends_above) & ((self.left(x, y) > 0) == ends_above)
        return jnp.where(crosses, jnp.where(ends_above, self.turn, -self.turn), 0)

    def is_crossed(self, before: RobotState, after: RobotState) -> Flag:
        """Check whether the ends of the edge, and those of a step, lie on different sides of the
        other.
        """
        dx, dy = after.x - before.x, after.y - before.y
        x, y = self.x - before.x, self.y - before.y
        sides = (dx * y - dy * x) * (dx * (y + self.along_y) - dy * (x + self.along_x))
        return (self.left(before.x, before.y) * self.left(after.x, after.y) < 0) & (sides < 0)


class PointToEdges(eqx.Module):
    """A point (x, y) [m] among the edges so far: its squared distance from the nearest [m^2], and
    their windings.
    """

    x: Scalar
    y: Scalar
    squared: Scalar
    windings: Int[Array, ""]

    def with_edge(self, edge: Edge) -> "PointToEdges":
        """Return the point with one more edge."""
        squared = closest_approach_squared(
            edge.x - self.x, edge.y - self.y, edge.along_x, edge.along_y
        )
        windings = self.windings + edge.windings(self.x, self.y)
        return PointToEdges(self.x, self.y, jnp.minimum(self.squared, squared), windings)

    @property
    def clearance(self) -> Scalar:
        """The distance [m] from the nearest edge; negative inside."""
        distance = jnp.sqrt(self.squared)
        return jnp.where(self.windings > 0, -distance, distance)


class _Segment(NamedTuple):
    """A segment among the edges so far: both ends, and the least clearance between them [m]."""

    start: PointToEdges
    end: PointToEdges
    between: Scalar


class Edges(AbstractObstacle):
    """The edges of any number of polygons as one obstacle, leaves `[edges]`."""

    edges: Edge

    @classmethod
    def of(cls, polygons: Sequence[Polygon]) -> "Edges":
        """Return the edges of polygons, one polygon after the other: scanned one by one they take
        least arithmetic.
        """
        corners = [_corners(polygon) for polygon in polygons]
        # compiles sooner than one polygon after another
        if len({places.shape for places in corners}) == 1:
            numbers = jax.vmap(_numbers)(jnp.stack(corners))
            numbers = tuple(number.reshape(-1) for number in numbers)
        else:
            columns = zip(*map(_numbers, corners), strict=True)
            numbers = tuple(jnp.concatenate(parts) for parts in columns)
        return cls(jax.vmap(Edge)(*numbers))

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Return the distance [m] from a point to the nearest edge; negative inside a polygon."""
        return self._over_edges(
            lambda place, edge: place.with_edge(edge), far_from_edges(x, y)
        ).clearance

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Return the least clearance [m] on the segment between two states.

        Outside it is exact: the least distance of any point of the segment from any edge. Of a
        segment that touches the inside it is negative: the clearance of the deeper end, or
        `_PASSED_THROUGH` where both ends are outside.
        """
        dx, dy = after.x - before.x, after.y - before.y

        def add_edge(segment: _Segment, edge: Edge) -> _Segment:
            corner = closest_approach_squared(before.x - edge.x, before.y - edge.y, dx, dy)
            clearance = jnp.where(edge.is_crossed(before, after), _PASSED_THROUGH, jnp.sqrt(corner))
            return _Segment(
                start=segment.start.with_edge(edge),
                end=segment.end.with_edge(edge),
                between=jnp.minimum(segment.between, clearance),
            )

        no_edges = _Segment(
            start=far_from_edges(before.x, before.y),
            end=far_from_edges(after.x, after.y),
            between=jnp.asarray(jnp.inf, jnp.float32),
        )
        segment = self._over_edges(add_edge, no_edges)
        ends = jnp.minimum(segment.start.clearance, segment.end.clearance)
        return jnp.minimum(ends, segment.between)

    def _over_edges(self, add_edge: Callable[[T, Edge], T], initial: T) -> T:
        def one_edge(value: T, edge: Edge) -> tuple[T, None]:
            return add_edge(value, edge), None

        end, _ = jax.lax.scan(one_edge, initial, self.edges)
        return end


def _corners(polygon: Polygon) -> Float[Array, "corners 2"]:
    vertices = polygon.vertices
    if isinstance(vertices, tuple):
        coordinates = [coordinate for corner in vertices for coordinate in corner]
        numbers = [jnp.asarray(coordinate, jnp.float32) for coordinate in coordinates]
        return jnp.stack(numbers).reshape(-1, 2)
    return jnp.asarray(vertices)


def _numbers(corners: Float[Array, "corners 2"]) -> tuple[Array, ...]:
    """Return the fields of `Edge` for the edges of one polygon, each `[corners]`."""
    (x, y), (next_x, next_y) = corners.T, jnp.roll(corners, -1, axis=0).T
    turn = jnp.where(jnp.sum(x * next_y - next_x * y) > 0, 1, -1)
    return x, y, next_x - x, next_y - y, jnp.full(x.shape, turn)


def far_from_edges(x: Scalar, y: Scalar) -> PointToEdges:
    """Return a point with no edges so far."""
    return PointToEdges(x, y, jnp.asarray(jnp.inf, jnp.float32), jnp.zeros((), jnp.int32))


def _crossing_edges(corners: Float[np.ndarray, "corners 2"]) -> Int[np.ndarray, " some"]:
    """Return the corners at which the first two edges begin that meet elsewhere than at a corner
    they share.
    """
    count = len(corners)
    along = np.roll(corners, -1, axis=0) - corners
    length = np.maximum(np.hypot(*along.T), _APART)[:, None]
    # By edge and corner: how far the corner is to the left of the edge's line, and how far ahead
    # along it [m].
    to_x, to_y = (corners[None] - corners[:, None]).transpose(2, 0, 1)
    offset = (along[:, :1] * to_y - along[:, 1:] * to_x) / length
    distance_ahead = (along[:, :1] * to_x + along[:, 1:] * to_y) / length
    edge, corner = np.indices((count, count))
    touches = np.abs(offset) <= _APART
    touches &= (distance_ahead >= -_APART) & (distance_ahead <= length + _APART)
    touches &= (corner != edge) & (corner != (edge + 1) % count)
    # The edge's line has the ends of another edge on different sides.
    separates = offset * np.roll(offset, -1, axis=1) < 0
    return np.argwhere(touches | (separates & separates.T))[:1].ravel()


def _places(corners: Float[np.ndarray, "corners 2"], which: Int[np.ndarray, " some"]) -> str:
    return ", ".join(f"({x:g}, {y:g})" for x, y in corners[which[:2]])
