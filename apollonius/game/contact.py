"""Contact with the obstacles of one arena of several, and clearance from them, computed only near
them.

A game among many arenas has as many discs and polygons as the fullest: too many to look at in every
step. Bounds of the distance to the nearest decide most questions, and the rest are few.
"""

import functools
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from apollonius.accelerate.batch_rule import broadcast_rows, with_batch_function
from apollonius.accelerate.few_rows import compute_where
from apollonius.game.arena import Disc
from apollonius.game.obstacle import AbstractObstacle
from apollonius.game.polygon import Edges
from apollonius.game.types import Flag, Real, RobotState, Scalar

_CELLS, _MORE_CELLS, _MOST_CELLS = 64, 128, 256
"""Cells along the longer side of an arena, for whose middles the distance is known: with fewer
edges than `_MANY`, with more in several arenas, and in one alone.
"""
_MANY = 512
_ROUNDING = 1e-3
"""Distance [m] that is left for rounding, many times that of single precision."""
_TOGETHER = 64
"""Robots of a batch that are looked at together."""


class ContactBounds(eqx.Module):
    """The discs and polygons of several arenas, and distances from them.

    Attributes:
        shapes: leaves `[arenas, shapes]`.
        distances: from the middle of each of `_CELLS` by `_CELLS` cells, or more, to the nearest
            disc or polygon [m]; negative inside one.
        x, y: the lower left corners of the arenas [m].
        cell: the sides of their cells [m].
    """

    shapes: "Shapes"
    distances: Float[Array, "arenas rows columns"]
    x: Float[Array, " arenas"]
    y: Float[Array, " arenas"]
    cell: Float[Array, " arenas"]

    @classmethod
    def of(
        cls,
        shapes: "Shapes",
        x: Float[Array, " arenas"],
        y: Float[Array, " arenas"],
        x_max: Float[Array, " arenas"],
        y_max: Float[Array, " arenas"],
    ) -> "ContactBounds":
        """Measure the distances from shapes in several arenas with these walls [m]."""
        arenas, edges = (0, 0) if shapes.edges is None else shapes.edges.edges.x.shape
        more = _MOST_CELLS if arenas == 1 else _MORE_CELLS
        cells = more if edges >= _MANY else _CELLS
        cell = jnp.maximum(x_max - x, y_max - y) / cells
        return cls(shapes, _distances(shapes, x, y, cell, cells), x, y, cell)

    def shapes_of(self, member: Int[Array, ""] | int) -> "Shapes":
        """Return the shapes of one arena."""
        return jax.tree.map(lambda leaf: leaf[member], self.shapes)

    def is_hit(
        self, member: Int[Array, ""], before: RobotState, after: RobotState, radius: Real
    ) -> Flag:
        """Check whether a body of this radius [m] touches a disc or polygon of one arena anywhere
        along a straight step.
        """
        reach = jnp.hypot(after.x - before.x, after.y - before.y) + radius
        least, _ = self.clearance_bounds(member, before.x, before.y)
        question = _Hits(least < reach, member, before, after, jnp.asarray(radius))
        return _answer(self.shapes, question)

    def is_clear(
        self,
        member: Int[Array, ""],
        x: Scalar,
        y: Scalar,
        distance: Real,
        matters: Flag | bool = True,
    ) -> Flag:
        """Check whether the nearest disc or polygon of one arena is at least a distance [m] away
        from a point; where it does not matter, the answer may be wrong.
        """
        least, most = self.clearance_bounds(member, x, y)
        is_open = (least < distance) & (distance <= most) & matters
        question = _IsClear(is_open, member, x, y, jnp.asarray(distance))
        return (least >= distance) | _answer(self.shapes, question)

    def clearance_bounds(
        self, member: Int[Array, ""], x: Scalar, y: Scalar
    ) -> tuple[Scalar, Scalar]:
        """Return bounds of the distance [m] from a point to the nearest disc or polygon: the
        distance from the middle of its cell, less and more by the way there.
        """
        cell = self.cell[member]
        right, up = x - self.x[member], y - self.y[member]
        last = self.distances.shape[-1] - 1
        column = jnp.clip(jnp.floor(right / cell), 0, last)
        row = jnp.clip(jnp.floor(up / cell), 0, last)
        distance = self.distances[member, row.astype(jnp.int32), column.astype(jnp.int32)]
        away = jnp.hypot(right - cell * (column + 0.5), up - cell * (row + 0.5)) + _ROUNDING
        return distance - away, distance + away


class Shapes(AbstractObstacle):
    """The discs of an arena, leaves `[discs]`, and the edges of its polygons, as one obstacle."""

    discs: Disc | None
    edges: Edges | None

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Return the distance [m] from a point to the nearest shape; negative inside."""
        return self._least(lambda shape: shape.clearance(x, y))

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Return the least clearance [m] on the segment between two states."""
        return self._least(lambda shape: shape.clearance_along(before, after))

    def is_hit(self, before: RobotState, after: RobotState, radius: Real) -> Flag:
        """Check whether a body of this radius [m] touches one anywhere along a straight step."""
        hit = jnp.zeros((), bool)
        if self.discs is not None:
            hit = jnp.any(jax.vmap(lambda disc: disc.is_hit(before, after, radius))(self.discs))
        return hit if self.edges is None else hit | self.edges.is_hit(before, after, radius)

    def _least(self, clearance: Callable[[AbstractObstacle], Scalar]) -> Scalar:
        least = jnp.full((), jnp.inf)
        if self.discs is not None:
            least = jnp.min(jax.vmap(clearance)(self.discs))
        return least if self.edges is None else jnp.minimum(least, clearance(self.edges))


@functools.partial(jax.jit, static_argnames="cells")
def _distances(
    shapes: Shapes, x: Array, y: Array, cell: Array, cells: int
) -> Float[Array, "arenas rows columns"]:
    middles = jnp.arange(cells, dtype=jnp.float32) + 0.5

    @jax.vmap
    def of_arena(
        shapes: Shapes, x: Scalar, y: Scalar, cell: Scalar
    ) -> Float[Array, "rows columns"]:
        columns, rows = x + cell * middles, y + cell * middles
        return jax.vmap(jax.vmap(shapes.clearance, (0, None)), (None, 0))(columns, rows)

    return of_arena(shapes, x, y, cell)


class _Question(eqx.Module):
    """A question about the shapes of one arena; the answer is no where bounds have decided it."""

    is_open: Flag
    member: Int[Array, ""]

    def answer(self, shapes: Shapes) -> Flag:
        """Return the answer from the shapes of all arenas."""
        return self.ask(jax.tree.map(lambda leaf: leaf[self.member], shapes))

    @abstractmethod
    def ask(self, shapes: Shapes) -> Flag:
        """Return the answer from the shapes of the arena."""


class _Hits(_Question):
    before: RobotState
    after: RobotState
    radius: Scalar

    def ask(self, shapes: Shapes) -> Flag:
        return shapes.is_hit(self.before, self.after, self.radius)


class _IsClear(_Question):
    x: Scalar
    y: Scalar
    distance: Scalar

    def ask(self, shapes: Shapes) -> Flag:
        return shapes.clearance(self.x, self.y) >= self.distance


def _answer_few(
    size: int, batched: Any, shapes: Shapes, question: _Question
) -> Bool[Array, " rows"]:
    questions = broadcast_rows(size, batched[1], question)

    def some(rows: Int[Array, " few"]) -> Bool[Array, " few"]:
        few = jax.tree.map(lambda leaf: leaf[rows], questions)
        return jax.vmap(lambda question: question.answer(shapes))(few)

    return compute_where(questions.is_open, some, jnp.zeros(size, bool), min(size, _TOGETHER))


@with_batch_function(_answer_few)
def _answer_one(shapes: Shapes, question: _Question) -> Flag:
    return jax.lax.cond(
        question.is_open, lambda: question.answer(shapes), lambda: jnp.zeros((), bool)
    )


def _answer(shapes: Shapes, question: _Question) -> Flag:
    """Answer a question that is open; of a batch the open ones, a few at a time."""
    return _answer_one(shapes, jax.lax.stop_gradient(question))
