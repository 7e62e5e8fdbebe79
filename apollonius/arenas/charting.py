"""Charting: the field of clearances of an arena and all its shortest paths, once before anyone
plays there.
"""

import functools
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt, UInt16

from apollonius.arenas.hubs import paths_by_hubs
from apollonius.game.arena import Arena
from apollonius.game.chart import (
    COARSE,
    LARGE_COARSE,
    LARGE_SIDE,
    NO_PATH,
    SIDE,
    Chart,
    Hubs,
    cell_bits,
    entries,
)
from apollonius.game.game import Game
from apollonius.game.obstacle import between_nodes, bilinear
from apollonius.game.packed_arena import pack
from apollonius.game.types import Flag, Scalar
from apollonius.io.cache import Memory

_STEPS = ((1, 0), (0, 1), (1, 1), (-1, 1), (2, 1), (-2, 1), (1, 2), (-1, 2))
"""From each coarse cell to those beside it, columns and rows: eight directions, and as many between
them both ways.
"""
_WIDEST = (0.4, 0.8)
"""Greatest width of the coarse cells of an arena that is not large [m]: of one arena and with
bodies that of the largest robot, but within these bounds.
"""
_LOOKS = 16
"""Points of a line at which the clearance is looked up."""
_SLACK = 1e-4
"""By how much a body may be too large [m], so that where it just fits no rounding decides."""
_UNIT = 2**19
"""Lengths are whole numbers, so that sums are exact: of a step from a coarse cell to the next one.
"""
_FAR = 2**30 - 1
"""A length that no path has, and of which twice is a number."""
_TOGETHER = 64
"""Coarse cells from which paths are looked for at once."""
_Parts = tuple[Any, ...]
"""The fields of a chart of one arena in their order, as arrays of NumPy."""
_latest = Memory[_Parts](4)
"""The last charts, 5 MB each and 9 of a large arena: both players of a game ask for its chart."""
_Field = Float[Array, "corners corners"]
_Cells = Int[Array, "rows columns"]
_Lengths = Int[Array, "rows columns starts"]


def with_chart(game: Game, are_read: bool = True) -> Game:
    """Add charts of all its arenas to a game, by the paths of the largest robot.

    A game that has charts stays as it is, and one in which nobody reads them: no player
    (`are_read`) and not the reward.
    """
    if game.chart is not None or not (are_read or game.reward.along_paths):
        return game
    scenario = game.scenario
    arenas = scenario.each() if scenario else [game.arena]
    radius = largest_radius(game)
    width = 2 * radius if radius and scenario is None else np.inf
    widest = float(np.clip(width, *_WIDEST))
    is_large = max(map(_side, arenas)) > COARSE * widest
    charts = [
        _latest.get((arena, radius, is_large), functools.partial(_draw, arena, radius, is_large))
        for arena in arenas
    ]
    parts = jax.tree.map(lambda *leaves: np.concatenate(leaves), *charts)
    return replace(game, chart=Chart(*jax.device_put(parts)))


def largest_radius(game: Game) -> float:
    """Return the radius of a game's largest robot [m], for which its chart is drawn."""
    kinds = game.scenario.kinds if game.scenario else None
    single = [body for side in game.bodies for body in side]
    bodies = single if kinds is None else [kinds.pursuer, kinds.evader]
    return max(float(np.max(np.asarray(body.radius))) for body in bodies)


def _side(arena: Arena) -> float:
    """Return an arena's longer side [m]."""
    return max(float(arena.x_max) - float(arena.x_min), float(arena.y_max) - float(arena.y_min))


def _draw(arena: Arena, radius: float, is_large: bool) -> _Parts:
    """Draw the chart of an arena for robots of a radius [m]."""
    x, y, side = float(arena.x_min), float(arena.y_min), _side(arena)
    cells, columns = (LARGE_SIDE, LARGE_COARSE) if is_large else (SIDE, COARSE)
    corners = np.linspace(0, side, cells + 1, dtype=np.float32)
    field = clearances(pack(arena), jnp.asarray(x + corners), jnp.asarray(y + corners))
    body, hubs = jnp.asarray(radius, jnp.float32), None
    if is_large:
        steps, visible = steps_and_sight(field, body, columns)
        lengths, *nearest = paths_by_hubs(np.asarray(steps[0] < _FAR), _STEPS, side / columns)
        hubs = Hubs(*(jnp.asarray(table)[None] for table in nearest))
    else:
        lengths, visible = paths(field, jnp.asarray(side, jnp.float32), body)
    numbers = (jnp.asarray(number, jnp.float32) for number in (x, y, side))
    links = entries(field, visible, columns)
    arrays = (jnp.asarray(array)[None] for array in (field, lengths, visible, *numbers, links))
    return jax.tree.map(np.asarray, (*arrays, hubs))


@eqx.filter_jit
def clearances(
    arena: Arena, x: Float[Array, " columns"], y: Float[Array, " rows"]
) -> Float[Array, "rows columns"]:
    """Return the clearances [m] of an arena on a grid, rows by `y`."""
    return jax.lax.map(lambda y: jax.vmap(lambda x: arena.clearance(x, y))(x), y)


@jax.jit
def paths(
    field: _Field, side: Scalar, radius: Scalar
) -> tuple[UInt16[Array, "coarse coarse"], UInt16[Array, "cells cells"]]:
    """Compute `Chart.lengths` and `Chart.visible` of a field.

    Args:
        field: clearances at the corners of cells [m].
        side: the arena's longer side [m].
        radius: radius of the largest body [m].
    """
    steps, visible = steps_and_sight(field, radius, COARSE)

    def lengths_from(starts: Int[Array, " starts"]) -> UInt16[Array, "starts coarse"]:
        unit_lengths = _paths_from(steps, starts)
        centimetres = jnp.round(unit_lengths.astype(jnp.float32) / _UNIT * (100 * side / COARSE))
        lengths = jnp.where(unit_lengths >= _FAR, NO_PATH, jnp.minimum(centimetres, NO_PATH))
        return lengths.astype(jnp.uint16).T

    starts = jnp.arange(COARSE**2).reshape(-1, _TOGETHER)
    return jax.lax.map(lengths_from, starts).reshape(COARSE**2, COARSE**2), visible


@functools.partial(jax.jit, static_argnames="columns")
def steps_and_sight(
    field: _Field, radius: Scalar, columns: int
) -> tuple[Int[Array, "2 steps rows columns"], UInt[Array, "cells cells"]]:
    """Compute the steps between coarse cells in which a robot fits, as in `_links`, and
    `Chart.visible`.

    Args:
        field: clearances at the corners of cells [m].
        radius: radius of the largest body [m].
        columns: coarse cells along a side.
    """
    steps = _links(field, radius, columns)
    is_linked = jnp.min(jnp.minimum(steps[0], jnp.flip(steps[1], (1, 2))), axis=0) < _FAR
    return steps, _visible(field, is_linked)


def _is_clear(
    field: _Field, x: Scalar, y: Scalar, to_x: Scalar, to_y: Scalar, radius: Scalar | float
) -> Flag:
    """Check whether a body fits all along a line between two points in cells."""

    corners = field.shape[0]

    def look(number: Int[Array, ""], clear: Flag) -> Flag:
        share = number / (_LOOKS - 1)
        place = x + share * (to_x - x), y + share * (to_y - y)
        across, upwards = (between_nodes(coordinate, corners) for coordinate in place)
        return clear & (bilinear(lambda row, column: field[row, column], across, upwards) > radius)

    return jax.lax.fori_loop(0, _LOOKS, look, jnp.asarray(True))


def _links(field: _Field, radius: Scalar, columns: int) -> Int[Array, "2 steps rows columns"]:
    """Return the lengths of steps that lead to each coarse cell: of `_STEPS`, and with the arena
    turned half round.
    """
    numbers = jnp.arange(columns, dtype=jnp.float32)
    cell = (field.shape[0] - 1) / columns

    def link(step: Float[Array, "2"], row: Scalar, column: Scalar) -> Int[Array, ""]:
        from_column, from_row = column - step[0], row - step[1]
        in_columns = (from_column >= 0) & (from_column < columns)
        is_inside = in_columns & (from_row >= 0) & (from_row < columns)
        x, y, from_x, from_y = (
            (place + 0.5) * cell for place in (column, row, from_column, from_row)
        )
        length = jnp.round(_UNIT * jnp.hypot(step[0], step[1])).astype(jnp.int32)
        return jnp.where(
            is_inside & _is_clear(field, x, y, from_x, from_y, radius - _SLACK), length, _FAR
        )

    def along(step: Float[Array, "2"]) -> Int[Array, "rows columns"]:
        return jax.lax.map(
            lambda row: jax.vmap(lambda column: link(step, row, column))(numbers), numbers
        )

    steps = jnp.asarray(_STEPS, jnp.float32)
    forward, backward = jax.lax.map(along, steps), jax.lax.map(along, -steps)
    return jnp.stack([forward, jnp.flip(backward, (1, 2))])


class _Sweeps(NamedTuple):
    """Path lengths, 1 if the arena is turned by half a turn, and sweeps that changed nothing."""

    lengths: _Lengths
    turned: Int[Array, ""]
    unchanged: Int[Array, ""]


def _paths_from(
    links: Int[Array, "2 steps rows columns"], starts: Int[Array, " starts"]
) -> Int[Array, "coarse starts"]:
    """Return the lengths of the shortest paths from some coarse cells to all.

    Sweeps go over the rows from below, and from above as the arena is turned by half a turn after
    each, until two in a row have changed nothing.
    """

    def sweep(before: _Sweeps) -> _Sweeps:
        after = _sweep_up(before.lengths, links[before.turned])
        unchanged = jnp.where(jnp.any(after != before.lengths), 0, before.unchanged + 1)
        return _Sweeps(jnp.flip(after, (0, 1)), 1 - before.turned, unchanged)

    none = jnp.asarray(0)
    first = jnp.where(jnp.arange(COARSE**2)[:, None] == starts[None], 0, _FAR).reshape(
        COARSE, COARSE, -1
    )
    start = _Sweeps(first, none, none)
    end = jax.lax.while_loop(lambda sweeps: sweeps.unchanged < 2, sweep, start)
    lengths = jnp.where(end.turned == 1, jnp.flip(end.lengths, (0, 1)), end.lengths)
    return lengths.reshape(COARSE**2, -1)


def _sweep_up(lengths: _Lengths, links: Int[Array, "steps rows columns"]) -> _Lengths:
    """Shorten paths by last steps upwards and to the right, row by row from below."""
    columns = lengths.shape[1]

    def rightwards(
        before: Int[Array, " starts"], row_and_links: tuple[Array, Array]
    ) -> tuple[Array, Array]:
        length = jnp.minimum(row_and_links[0], before + row_and_links[1])
        return length, length

    def upwards(
        before: tuple[Array, Array], row_and_links: tuple[Array, Array]
    ) -> tuple[tuple[Array, Array], Array]:
        row, links = row_and_links
        for number, (right, up) in enumerate(_STEPS[1:], 1):
            wide = jnp.pad(before[up - 1], ((2, 2), (0, 0)), constant_values=_FAR)
            row = jnp.minimum(row, wide[2 - right : 2 - right + columns] + links[number, :, None])
        _, row = jax.lax.scan(rightwards, jnp.full_like(row[0], _FAR), (row, links[0]))
        return (row, before[0]), row

    blank = jnp.full_like(lengths[0], _FAR)
    return jax.lax.scan(upwards, (blank, blank), (lengths, jnp.moveaxis(links, 1, 0)))[1]


class _Visibility(NamedTuple):
    """Bits of visible coarse cells, the nearest one, -1 without any, and its distance."""

    bits: Int[Array, ""]
    nearest: Int[Array, ""]
    shortest: Scalar


def _visible(field: _Field, is_linked: Bool[Array, "rows columns"]) -> UInt[Array, "cells cells"]:
    """Compute `Chart.visible`: the bits of visible coarse cells, and the nearest one."""
    side_cells, columns = field.shape[0] - 1, len(is_linked)
    dtype = jnp.dtype(jnp.uint16 if columns == COARSE else jnp.uint32)
    bits = cell_bits(dtype)
    coarse_cell = side_cells / columns
    is_linked_cell = is_linked.ravel()

    def of_cell(row: Scalar, column: Scalar) -> tuple[Int[Array, ""], Int[Array, ""]]:
        x, y = column + 0.5, row + 0.5
        left = jnp.clip(jnp.floor(x / side_cells * columns - 0.5), 0, columns - 2)
        low = jnp.clip(jnp.floor(y / side_cells * columns - 0.5), 0, columns - 2)

        def try_cell(bit: Int[Array, ""], before: _Visibility) -> _Visibility:
            right, up = bit % 2, bit // 2
            to_column = left + right.astype(jnp.float32)
            to_row = low + up.astype(jnp.float32)
            cell = (to_row * columns + to_column).astype(jnp.int32)
            to_x, to_y = (to_column + 0.5) * coarse_cell, (to_row + 0.5) * coarse_cell
            is_seen = is_linked_cell[cell] & _is_clear(field, x, y, to_x, to_y, 0.0)
            distance = jnp.hypot(x - to_x, y - to_y)
            is_nearer = is_seen & (distance < before.shortest)
            return _Visibility(
                bits=before.bits | (is_seen.astype(jnp.int32) << (bits + bit)),
                nearest=jnp.where(is_nearer, cell, before.nearest),
                shortest=jnp.where(is_nearer, distance, before.shortest),
            )

        start = _Visibility(jnp.asarray(0), jnp.asarray(-1), jnp.asarray(jnp.inf))
        visibility = jax.lax.fori_loop(0, 4, try_cell, start)
        return visibility.bits, visibility.nearest

    cells = jnp.arange(side_cells, dtype=jnp.float32)
    visible_bits, nearest = jax.lax.map(
        lambda row: jax.vmap(lambda column: of_cell(row, column))(cells), cells
    )
    is_free = field[1:, 1:] + field[1:, :-1] + field[:-1, 1:] + field[:-1, :-1] > 0
    nearest = _flood(_flood(nearest, is_free), jnp.ones_like(is_free))
    return (visible_bits | jnp.maximum(nearest, 0)).astype(dtype)


def _flood(nearest: _Cells, may: Bool[Array, "rows columns"]) -> _Cells:
    """Flood the numbers of coarse cells into unlabelled cells, -1, of a mask (`may`)."""

    def widen(carry: tuple[_Cells, Flag]) -> tuple[_Cells, Flag]:
        cells, _ = carry
        wide = jnp.pad(cells, 1, constant_values=-1)
        across = jnp.maximum(wide[1:-1, 2:], wide[1:-1, :-2])
        along = jnp.maximum(wide[2:, 1:-1], wide[:-2, 1:-1])
        after = jnp.where((cells < 0) & may, jnp.maximum(across, along), cells)
        return after, jnp.any(after != cells)

    return jax.lax.while_loop(lambda carry: carry[1], widen, (nearest, jnp.asarray(True)))[0]
