"""Charts drawn: the field of clearances, and all shortest ways, once for an arena before anyone plays there."""

import functools
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt16

from apollonius.game.arena import Arena
from apollonius.game.chart import NO_WAY, SIDE, STOP_BITS, STOPS, Chart
from apollonius.game.game import Game
from apollonius.io.cache import Memory

_STEPS = ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2), (2, -1), (1, -2))
"""From each stop to those beside it, columns and rows: eight directions, and as many between them both ways."""
_LOOKS = 16
"""Places on a line at which is looked whether there is room."""
_Leaves = tuple[np.ndarray, ...]
"""Those of a chart in their order, without the axis of arenas."""
_latest = Memory[_Leaves](4)
"""Of 5 MB each: one game is asked for its chart by both its players."""
_Field = Float[np.ndarray, "corners corners"]


def charted(game: Game) -> Game:
    """The same game with charts of all its arenas, by the ways of the larger robot; nothing if they are there."""
    if game.scenario is None:
        if game.arena.chart is not None:
            return game
        chart = _charts([game.arena], largest_radius(game))
        return replace(game, arena=replace(game.arena, chart=chart))
    scenario = game.scenario
    if scenario.arenas.chart is not None:
        return game
    alone = [scenario.arena(jnp.asarray(number)) for number in range(scenario.count)]
    arenas = replace(scenario.arenas, chart=_charts(alone, largest_radius(game)))
    return replace(game, scenario=replace(scenario, arenas=arenas))


def largest_radius(game: Game) -> float:
    """Return the radius of a game's largest robot [m], for which its chart is drawn."""
    makes = game.scenario.makes if game.scenario else None
    bodies = [body for side in game.bodies for body in side] if makes is None else [makes.pursuer, makes.evader]
    return max(float(np.max(np.asarray(body.radius))) for body in bodies)


def _charts(arenas: list[Arena], radius: float) -> Chart:
    drawn = [_latest.get((arena, radius), functools.partial(_drawn, arena, radius)) for arena in arenas]
    stacked = [np.stack(leaves) for leaves in zip(*drawn, strict=True)]
    return Chart(*(jnp.asarray(leaf) for leaf in stacked[:3]), *(jnp.asarray(leaf[:, 0]) for leaf in stacked[3:]))


def _drawn(arena: Arena, radius: float) -> _Leaves:
    """One arena's chart."""
    x, y = float(arena.x_min), float(arena.y_min)
    side = max(float(arena.x_max) - x, float(arena.y_max) - y)
    corners = np.linspace(0, side, SIDE + 1, dtype=np.float32)
    field = np.asarray(_clearances(arena, jnp.asarray(x + corners), jnp.asarray(y + corners)))
    middles = (np.arange(STOPS) + 0.5) / STOPS
    columns, rows = np.meshgrid(middles, middles)
    at = np.stack([columns.ravel(), rows.ravel()], axis=1) * SIDE
    open_ = _look(field, at) > radius
    ways = _ways(field, at, open_, side, radius)
    reached = ways.min(axis=1, initial=np.inf, where=~np.eye(len(ways), dtype=bool)) < np.inf
    beside = _beside(field, at, open_ & reached)
    lengths = np.minimum(np.round(100 * ways), NO_WAY).astype(np.uint16)
    numbers = np.array([x, y, side], np.float32)
    return field, lengths, beside, *numbers[:, None]


@eqx.filter_jit
def _clearances(arena: Arena, x: Float[Array, " corners"], y: Float[Array, " corners"]) -> Float[Array, "y x"]:
    return jax.lax.map(lambda y: jax.vmap(lambda x: arena.clearance(x, y))(x), y)


def _look(field: _Field, at: Float[np.ndarray, "*points 2"]) -> Float[np.ndarray, "*points"]:
    """The field between its corners; `at` in cells, x first."""
    inside = np.clip(at, 0, SIDE - 1e-3)
    first = inside.astype(int)
    right, up = np.moveaxis(inside - first, -1, 0)
    column, row = first[..., 0], first[..., 1]
    below = (1 - right) * field[row, column] + right * field[row, column + 1]
    return (1 - up) * below + up * ((1 - right) * field[row + 1, column] + right * field[row + 1, column + 1])


def _are_clear(
    field: _Field, start: Float[np.ndarray, "lines 2"], end: Float[np.ndarray, "lines 2"], radius: float
) -> Bool[np.ndarray, " lines"]:
    """Whether a body fits all along some lines."""
    clear = np.ones(len(start), bool)
    for share in np.linspace(0, 1, _LOOKS):
        clear &= _look(field, start + share * (end - start)) > radius
    return clear


def _ways(
    field: _Field, at: Float[np.ndarray, "stops 2"], is_open: Bool[np.ndarray, " stops"], side: float, radius: float
) -> Float[np.ndarray, "stops stops"]:
    """Lengths [m] of the shortest ways; inf where there is none."""
    from scipy.sparse import coo_array  # 0.3 s, for none but those who draw charts
    from scipy.sparse.csgraph import dijkstra

    rows, columns = np.divmod(np.arange(STOPS**2), STOPS)
    starts: list[Int[np.ndarray, " some"]] = []
    ends: list[Int[np.ndarray, " some"]] = []
    lengths: list[Float[np.ndarray, " some"]] = []
    for right, up in _STEPS:
        column, row = columns + right, rows + up
        inside = (column < STOPS) & (row >= 0) & (row < STOPS)
        start, end = np.flatnonzero(inside), (row * STOPS + column)[inside]
        both = is_open[start] & is_open[end]
        start, end = start[both], end[both]
        clear = _are_clear(field, at[start], at[end], radius)
        starts.append(start[clear])
        ends.append(end[clear])
        lengths.append(np.full(int(clear.sum()), np.hypot(right, up) * side / STOPS))
    graph = coo_array(
        (np.concatenate(lengths), (np.concatenate(starts), np.concatenate(ends))), shape=(STOPS**2, STOPS**2)
    )
    return np.asarray(dijkstra(graph.tocsr(), directed=False))


def _beside(
    field: _Field, at: Float[np.ndarray, "stops 2"], is_open: Bool[np.ndarray, " stops"]
) -> UInt16[np.ndarray, "cells cells"]:
    """What `Chart.beside` says."""
    middles = (np.arange(SIDE) + 0.5) / SIDE
    before = np.clip(np.floor(middles * STOPS - 0.5), 0, STOPS - 2).astype(int)
    columns, rows = np.meshgrid(middles, middles)
    cells = np.stack([columns.ravel(), rows.ravel()], axis=1) * SIDE
    first = (before[:, None] * STOPS + before[None, :]).ravel()
    seen = np.zeros(SIDE**2, int)
    found = np.full(SIDE**2, -1)
    shortest = np.full(SIDE**2, np.inf)
    free = np.flatnonzero(_look(field, cells) > 0)
    for bit, number in enumerate((0, 1, STOPS, STOPS + 1)):
        stop = first[free] + number
        visible = is_open[stop] & _are_clear(field, cells[free], at[stop], 0.0)
        seen[free[visible]] |= 1 << (STOP_BITS + bit)
        away = np.hypot(*(cells[free] - at[stop]).T)
        nearer = visible & (away < shortest[free])
        shortest[free[nearer]] = away[nearer]
        found[free[nearer]] = stop[nearer]
    return (seen.reshape(SIDE, SIDE) | _spread(found.reshape(SIDE, SIDE), field)).astype(np.uint16)


def _spread(found: Int[np.ndarray, "cells cells"], field: _Field) -> Int[np.ndarray, "cells cells"]:
    """Each cell that has no stop takes that of one beside it that has, first through free cells, then through all."""
    middles = (field[1:, 1:] + field[1:, :-1] + field[:-1, 1:] + field[:-1, :-1]) / 4
    for may in (middles > 0, np.ones(found.shape, bool)):
        while True:
            wide = np.pad(found, 1, constant_values=-1)
            beside = np.max([wide[1:-1, 2:], wide[1:-1, :-2], wide[2:, 1:-1], wide[:-2, 1:-1]], axis=0)
            new = (found < 0) & may & (beside >= 0)
            if not new.any():
                break
            found = np.where(new, beside, found)
    return np.maximum(found, 0)
