"""Contact with the obstacles of one arena of several, and clearance from them, computed only near
them.

A game among many arenas has as many discs and polygons as the fullest: too many to look at in every
step. Bounds of the distance to the nearest decide most questions, and the rest are few.
"""

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from apollonius.accelerate.batch_rule import broadcast_rows, with_batch_function
from apollonius.accelerate.few_rows import compute_where
from apollonius.game.arena import Arena, Disc
from apollonius.game.polygon import Edges, Polygon
from apollonius.game.types import Flag, Real, RobotState, Scalar

_CELLS = 64
"""Cells along the longer side of an arena, for whose middles the distance is known."""
_ROUNDING = 1e-3
"""Distance [m] that is left for rounding, many times that of single precision."""
_TOGETHER = 64
"""Robots of a batch that are looked at together."""


class ContactBounds(eqx.Module):
    """The discs and polygons of several arenas, and distances from them.

    Attributes:
        shapes: leaves `[arenas, shapes]`.
        distances: from the middle of each of `_CELLS` by `_CELLS` cells to the nearest disc or
            polygon [m]; negative inside one.
        x, y: the lower left corners of the arenas [m].
        cell: the sides of their cells [m].
    """

    shapes: "_Shapes"
    distances: Float[Array, "arenas rows columns"]
    x: Float[Array, " arenas"]
    y: Float[Array, " arenas"]
    cell: Float[Array, " arenas"]

    @classmethod
    def of(cls, arenas: Arena) -> "ContactBounds":
        """Measure the distances in several arenas, leaves `[arenas]`."""
        x, y = jnp.asarray(arenas.x_min), jnp.asarray(arenas.y_min)
        cell = jnp.maximum(arenas.x_max - x, arenas.y_max - y) / _CELLS
        shapes = _shapes_of(arenas.discs, arenas.polygons)
        return cls(shapes, _distances(shapes, x, y, cell), x, y, cell)

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
        column = jnp.clip(jnp.floor(right / cell), 0, _CELLS - 1)
        row = jnp.clip(jnp.floor(up / cell), 0, _CELLS - 1)
        distance = self.distances[member, row.astype(jnp.int32), column.astype(jnp.int32)]
        away = jnp.hypot(right - cell * (column + 0.5), up - cell * (row + 0.5)) + _ROUNDING
        return distance - away, distance + away


class _Shapes(eqx.Module):
    """The discs of an arena, leaves `[discs]`, and the edges of its polygons."""

    discs: Disc | None
    edges: Edges | None

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Return the distance [m] from a point to the nearest shape; negative inside."""
        least = jnp.full((), jnp.inf)
        if self.discs is not None:
            least = jnp.min(jax.vmap(lambda disc: disc.clearance(x, y))(self.discs))
        return least if self.edges is None else jnp.minimum(least, self.edges.clearance(x, y))

    def is_hit(self, before: RobotState, after: RobotState, radius: Scalar) -> Flag:
        """Check whether a body of this radius [m] touches one anywhere along a straight step."""
        hit = jnp.zeros((), bool)
        if self.discs is not None:
            hit = jnp.any(jax.vmap(lambda disc: disc.is_hit(before, after, radius))(self.discs))
        return hit if self.edges is None else hit | self.edges.is_hit(before, after, radius)


@jax.jit
@jax.vmap
def _shapes_of(discs: tuple[Disc, ...], polygons: tuple[Polygon, ...]) -> _Shapes:
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *discs) if discs else None
    return _Shapes(stacked, Edges.of(polygons) if polygons else None)


@jax.jit
@jax.vmap
def _distances(shapes: _Shapes, x: Scalar, y: Scalar, cell: Scalar) -> Float[Array, "rows columns"]:
    middles = cell * (jnp.arange(_CELLS, dtype=jnp.float32) + 0.5)
    return jax.vmap(jax.vmap(shapes.clearance, (0, None)), (None, 0))(x + middles, y + middles)


class _Question(eqx.Module):
    """A question about the shapes of one arena; the answer is no where bounds have decided it."""

    is_open: Flag
    member: Int[Array, ""]

    def answer(self, shapes: _Shapes) -> Flag:
        """Return the answer from the shapes of all arenas."""
        return self.ask(jax.tree.map(lambda leaf: leaf[self.member], shapes))

    @abstractmethod
    def ask(self, shapes: _Shapes) -> Flag:
        """Return the answer from the shapes of the arena."""


class _Hits(_Question):
    before: RobotState
    after: RobotState
    radius: Scalar

    def ask(self, shapes: _Shapes) -> Flag:
        return shapes.is_hit(self.before, self.after, self.radius)


class _IsClear(_Question):
    x: Scalar
    y: Scalar
    distance: Scalar

    def ask(self, shapes: _Shapes) -> Flag:
        return shapes.clearance(self.x, self.y) >= self.distance


def _answer_few(
    size: int, batched: Any, shapes: _Shapes, question: _Question
) -> Bool[Array, " rows"]:
    questions = broadcast_rows(size, batched[1], question)

    def some(rows: Int[Array, " few"]) -> Bool[Array, " few"]:
        few = jax.tree.map(lambda leaf: leaf[rows], questions)
        return jax.vmap(lambda question: question.answer(shapes))(few)

    return compute_where(questions.is_open, some, jnp.zeros(size, bool), min(size, _TOGETHER))


@with_batch_function(_answer_few)
def _answer_one(shapes: _Shapes, question: _Question) -> Flag:
    return jax.lax.cond(
        question.is_open, lambda: question.answer(shapes), lambda: jnp.zeros((), bool)
    )


def _answer(shapes: _Shapes, question: _Question) -> Flag:
    """Answer a question that is open; of a batch the open ones, a few at a time."""
    return _answer_one(shapes, jax.lax.stop_gradient(question))
