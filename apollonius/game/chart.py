"""What is known of an arena beforehand: how much room there is at each place, and how long the ways between places are.

A chart is drawn once (`apollonius.arenas.charting`); the game itself never asks it, only players do.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt16

from apollonius.game.occupancy import beside
from apollonius.game.types import Scalar

SIDE = 192
"""Cells of the field of clearances along the arena's longer side."""
STOPS = 40
"""Stops along the longer side, between which the ways are known."""
STOP_BITS = 11
"""Bits of a stop's number."""
NO_WAY = 2**16 - 1
"""The length of a way that there is not [cm]."""
GLANCES = 12
"""Steps in which a ray is followed: each is as long as there is room where the one before ended."""
FARTHEST = 12.0
"""Where rays end that meet nothing [m]."""

Places = tuple[Int[Array, "4"], Float[Array, "4"]]
"""Four stops beside a point, and their weights."""


class Chart(eqx.Module):
    """Charts of one or several arenas, squares on their lower left corners with sides as long as their longer ones.

    Attributes:
        field: distance [m] from walls and obstacles at the corners of `SIDE` by `SIDE` cells, the first row at the
            bottom; negative beyond them.
        ways: lengths [cm] of the shortest ways between `STOPS` by `STOPS` stops, in the middles of as many cells;
            a stop's number is `row * STOPS + column`.
        beside: for each cell of the field the stop that is nearest by the ways that there are (the lower `STOP_BITS`
            bits), and which of the four stops around its middle can be seen from there: the next bits stand for those
            at its lower left, lower right, upper left and upper right.
        x, y: the lower left corners [m].
        side: lengths of the sides [m].
        member: which of the arenas it is.
    """

    field: Float[Array, "arenas corners corners"]
    ways: UInt16[Array, "arenas stops stops"]
    beside: UInt16[Array, "arenas cells cells"]
    x: Float[Array, " arenas"]
    y: Float[Array, " arenas"]
    side: Float[Array, " arenas"]
    member: Int[Array, ""] | int = 0

    def room(self, x: Scalar, y: Scalar) -> Scalar:
        """Distance [m] from a point to the nearest wall or obstacle, interpolated; negative beyond."""
        member, cell = self.member, self.side[self.member] / SIDE
        column, right = beside((x - self.x[member]) / cell, SIDE + 1)
        row, up = beside((y - self.y[member]) / cell, SIDE + 1)
        below = (1 - right) * self.field[member, row, column] + right * self.field[member, row, column + 1]
        above = (1 - right) * self.field[member, row + 1, column] + right * self.field[member, row + 1, column + 1]
        return (1 - up) * below + up * above

    def range(self, x: Scalar, y: Scalar, cos: Scalar, sin: Scalar) -> Scalar:
        """Distance [m] from a point to the first wall or obstacle in a direction, `FARTHEST` at most.

        It is followed by sphere tracing (Hart, 1996), `GLANCES` steps: along a long wall it is too short.
        """

        def on(_: Int[Array, ""], along: Scalar) -> Scalar:
            return jnp.minimum(along + jnp.maximum(self.room(x + along * cos, y + along * sin), 0.0), FARTHEST)

        return jax.lax.fori_loop(0, GLANCES, on, jnp.zeros_like(x))

    def places(self, x: Scalar, y: Scalar) -> Places:
        """The stops around a point that can be seen from there, weighed by how near they are along x and y.

        Where none can be seen it is the nearest one alone.
        """
        member, side = self.member, self.side[self.member]
        shares = (x - self.x[member]) / side, (y - self.y[member]) / side
        cells = [jnp.clip(jnp.floor(share * SIDE), 0.0, SIDE - 1.0) for share in shares]
        column, row = (cell.astype(jnp.int32) for cell in cells)
        (left, right), (low, up) = (
            _between((cell + 0.5) / SIDE, share) for cell, share in zip(cells, shares, strict=True)
        )
        first = low * STOPS + left
        stops = jnp.stack([first, first + 1, first + STOPS, first + STOPS + 1])
        weights = jnp.stack([(1 - right) * (1 - up), right * (1 - up), (1 - right) * up, right * up])
        known = self.beside[member, row, column].astype(jnp.int32)
        seen = (known >> (STOP_BITS + jnp.arange(4, dtype=jnp.int32))) & 1
        weights = (weights + 1e-3) * seen.astype(jnp.float32)
        total = jnp.sum(weights)
        nearest = known & (2**STOP_BITS - 1)
        alone = jnp.array([1.0, 0.0, 0.0, 0.0])
        blind = total == 0
        return jnp.where(blind, nearest, stops), jnp.where(blind, alone, weights / jnp.where(blind, 1.0, total))

    def way(self, start: Places, end: Places) -> Scalar:
        """Length [m] of the shortest way between two points, to about half the distance between two stops."""
        (starts, start_weights), (ends, end_weights) = start, end
        lengths = self.ways[self.member, starts[:, None], ends[None, :]].astype(jnp.float32)
        return jnp.sum(start_weights[:, None] * lengths * end_weights[None, :]) / 100

    def way_from(self, stop: Int[Array, ""], end: Places) -> Scalar:
        """The same from one stop."""
        stops, weights = end
        return jnp.sum(self.ways[self.member, stop, stops].astype(jnp.float32) * weights) / 100


def _between(middle: Scalar, share: Scalar) -> tuple[Int[Array, ""], Scalar]:
    """The stop before a cell's middle along one axis, and how far a point is on the way to the next, from 0 to 1.

    Args:
        middle, share: of the cell's middle and of the point, shares of the side.
    """
    before = jnp.clip(jnp.floor(middle * STOPS - 0.5), 0.0, STOPS - 2.0)
    return before.astype(jnp.int32), jnp.clip(share * STOPS - 0.5 - before, 0.0, 1.0)
