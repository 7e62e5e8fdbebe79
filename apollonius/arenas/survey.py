"""A survey of an arena before training: parts that are cut off, havens, space to start, passages
that charts miss.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import distance_transform_edt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from apollonius.arenas.charting import clearances, largest_radius, with_chart
from apollonius.arenas.map_file import label_parts, share_of_unknown_cells
from apollonius.game.arena import Arena
from apollonius.game.chart import COARSE, NO_PATH, Chart
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game

Grid = Float[np.ndarray, "rows columns"]
_CELLS = 500
"""Cells along the arena's longer side."""
_LEAST_PART = 1e-4
"""Parts of the free space smaller than this share of the arena are specks of the grid."""
_SPECK = 4
"""Cells of the largest obstacle of a map that may be noise."""
_SHOWN = 12
"""Greatest number of specks whose places are shown."""
_LEAST_GAP = 0.1
"""Least distance between two bodies at a capture for which there is no note [m]."""
_LEAST_ROOM = 0.02
"""Least share of the arena on which a robot can start."""
_LONGER = 1.1
"""Factor by which a path of a chart may be longer than a straight one, as it goes in sixteen
directions.
"""
_DETOUR = 3.0 / COARSE
"""Share of the side by which a chart's path may be longer than the real one before a passage counts
as missed.
"""
_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""Steps from each cell of the raster to four of its eight neighbours, rows and columns."""


@dataclass(frozen=True)
class Survey:
    """Findings on a grid over an arena, `[rows, columns]`, the first row at the bottom.

    Attributes:
        blocked: cells in obstacles.
        parts: connected parts of the pursuer's and the evader's free space, numbered from 1; 0 is
            not free.
        haven: cells of the evader in which no pursuer that can start comes close enough to catch
            it.
        wrong: faults that spoil games in this arena, a line each.
        notes: odd but harmless facts, a line each.
    """

    blocked: Bool[np.ndarray, "rows columns"]
    parts: tuple[Int[np.ndarray, "rows columns"], Int[np.ndarray, "rows columns"]]
    haven: Bool[np.ndarray, "rows columns"]
    wrong: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _SideSurvey:
    """Connected parts of one robot's free space, those that it can be in, and faults."""

    parts: Int[np.ndarray, "rows columns"]
    reachable: Bool[np.ndarray, "rows columns"]
    faults: tuple[str, ...]


def survey(game: Game) -> Survey:
    """Survey a game's arena, to a five-hundredth of its longer side."""
    arena = game.arena
    x, y, cell, clearance = grid_points(arena)
    pursuer = _survey_side(game, "pursuer", game.pursuer, clearance, cell)
    evader = _survey_side(game, "evader", game.evader, clearance, cell)
    faults = [*pursuer.faults, *evader.faults]
    reach = np.asarray(distance_transform_edt(~pursuer.reachable)) * cell - cell
    haven = (evader.parts > 0) & (reach >= float(game.capture_distance))
    if haven.any():
        faults.append(
            f"the evader is safe on {cell**2 * haven.sum():.3g} m^2, where no pursuer comes within "
            f"capture_distance = {float(game.capture_distance):g} m as it does not fit: "
            "make the pursuer smaller or the passages wider."
        )
    goal = arena.territory
    if goal:
        in_goal = np.hypot(x - goal.x, y - goal.y) < goal.radius
        if not (in_goal & evader.reachable).any():
            remedy = "move it, or make the way wider"
            problem = "the evader cannot come into arena.territory from where it starts"
            faults.append(f"{problem}: {remedy}.")
    notes = map_notes(arena) + _capture_notes(game)
    parts = (pursuer.parts, evader.parts)
    return Survey(clearance < 0, parts, haven, tuple(faults), tuple(notes))


def _survey_side(
    game: Game, name: str, body: Unicycle, clearance: Grid, cell: float
) -> _SideSurvey:
    """Survey the free space of one side's robot, by clearances [m] on cells of a side [m]."""
    labels = _label_parts(clearance >= float(body.radius))
    start = clearance >= float(game.starts.clearance + body.radius)
    areas = [cell**2 * np.sum(labels == part) for part in range(1, labels.max() + 1)]
    faults: list[str] = []
    if len(areas) > 1:
        sizes = ", ".join(f"{area:.3g}" for area in sorted(areas, reverse=True))
        faults.append(
            f"the {name}'s free space falls into {len(areas)} parts of {sizes} m^2, "
            f"and it never leaves the one it starts in: widen the passages to more than "
            f"{name}.radius = {float(body.radius):g} m on each side, or fill the closed pockets."
        )
    if start.mean() < _LEAST_ROOM:
        faults.append(
            f"the {name} can start on {start.mean():.2%} of the arena only, "
            f"less than {_LEAST_ROOM:.0%}: make starts.clearance or the obstacles smaller."
        )
    # A part in which no robot starts is one that none ever enters.
    reachable = np.isin(labels, np.unique(labels[start])) & (labels > 0)
    return _SideSurvey(labels, reachable, tuple(faults))


def _capture_notes(game: Game) -> list[str]:
    """Note bodies that overlap, or nearly touch, at a capture."""
    radii = float(game.pursuer.radius + game.evader.radius)
    distance = float(game.capture_distance)
    if not radii or distance - radii >= _LEAST_GAP - 1e-6:
        return []
    gap = f"{distance - radii:.2g} m are left between the bodies at a capture"
    problem = f"{gap}, so that real robots touch"
    meaning = f"from centre to centre, and the radii are {radii:g} m together"
    if distance < radii:
        problem = "the bodies overlap before they count as caught"
    return [f"{problem}: capture_distance = {distance:g} m, {meaning}."]


def map_notes(arena: Arena) -> list[str]:
    """Note unknown cells of a map's file that are read as free, and specks that robots avoid."""
    if arena.map is None or not os.path.isfile(arena.map.file):
        return []
    path = Path(arena.map.file)
    notes: list[str] = []
    share = share_of_unknown_cells(path)
    if share:
        notes.append(
            f"unknown cells of the map, grey 205, are read as free, on {share:.1%} of it: "
            f"set free_thresh to 0.196 in '{path}' if no robot should go there."
        )
    parts, _ = label_parts(arena.map.occupied())
    _, firsts, sizes = np.unique(parts, return_index=True, return_counts=True)
    cell, specks = float(arena.map.cell), firsts[1:][sizes[1:] <= _SPECK]  # without what is free
    if len(specks):
        rows, columns = np.unravel_index(specks, parts.shape)
        x, y = float(arena.map.x) + (columns + 0.5) * cell, float(arena.map.y) + (rows + 0.5) * cell
        points = zip(x[:_SHOWN], y[:_SHOWN], strict=True)
        places_text = ", ".join(f"({column:.2f}, {row:.2f})" for column, row in points)
        rest = " and so on" if len(x) > _SHOWN else ""
        notes.append(
            f"specks on the map, of at most {_SPECK} cells: {len(specks)}, at {places_text}{rest}; "
            f"robots run round each; set least_obstacle to {(_SPECK + 0.5) * cell**2:.2g} m^2 "
            f"in '{path}' if they are noise, and no legs of chairs."
        )
    return notes


def grid_points(arena: Arena) -> tuple[Grid, Grid, float, Grid]:
    """Return the middles x, y [m] of square cells all over an arena, a cell's side [m], and their
    clearances [m].
    """
    width, height = float(arena.x_max - arena.x_min), float(arena.y_max - arena.y_min)
    cell = max(width, height) / _CELLS

    def middles(low: float, length: float) -> Float[np.ndarray, " cells"]:
        count = max(1, round(length / cell))
        return low + length * (np.arange(count) + 0.5) / count

    x, y = middles(float(arena.x_min), width), middles(float(arena.y_min), height)
    clearance = clearances(arena, jnp.asarray(x, jnp.float32), jnp.asarray(y, jnp.float32))
    return *np.meshgrid(x, y), cell, np.asarray(clearance, float)


def _label_parts(free: Bool[np.ndarray, "rows columns"]) -> Int[np.ndarray, "rows columns"]:
    """Number the connected parts from 1, without specks."""
    labels, count = label_parts(free)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    large_parts = [part for part in range(1, count + 1) if sizes[part] > _LEAST_PART * free.size]
    renumber = np.zeros(count + 1, int)
    renumber[large_parts] = np.arange(1, len(large_parts) + 1)
    return renumber[labels]


def missed_passage(game: Game) -> list[str]:
    """Return the note on the passage of one arena that costs players with a chart the longest
    detour, if they miss any.

    From every coarse cell of the chart, in a large arena from every hub, the free space is flooded
    on a fine raster. Where two floods meet, the robot can go from one cell to the other; the chart
    should have a path about as short.
    """
    arena = game.arena
    radius = largest_radius(game)
    chart = with_chart(game).chart
    assert chart is not None, "the game has a chart"
    lengths = np.asarray(chart.lengths)[0]
    side = float(np.asarray(chart.side)[0])
    x, y, cell, clearance = grid_points(arena)
    clearance -= radius
    graph, start, end, length = _links(clearance, cell)
    hubs, seeds = _flood_seeds(chart, cell, clearance.shape)
    if not len(seeds):
        return []
    distances, _, source = dijkstra(
        graph, directed=False, indices=seeds, min_only=True, return_predecessors=True
    )
    hub_at = np.zeros(clearance.size, int)
    hub_at[seeds] = hubs
    is_reached = np.isfinite(distances[start] + distances[end])
    meet = np.flatnonzero((source[start] != source[end]) & is_reached)
    if not len(meet):
        return []
    start, end = start[meet], end[meet]
    real_lengths = distances[start] + length[meet] + distances[end]
    chart_lengths = lengths[hub_at[source[start]], hub_at[source[end]]]
    excess = chart_lengths / 100 - _LONGER * real_lengths
    detour = np.where(chart_lengths == NO_PATH, np.inf, excess)
    worst = np.argmax(detour)
    if detour[worst] <= _DETOUR * side:
        return []
    place = ", ".join(f"{axis.ravel()[start[worst]]:.2f}" for axis in (x, y))
    detour_text = f"know a way that is {detour[worst]:.1f} m longer"
    if np.isinf(detour[worst]):
        detour_text = "know no other way"
    resolution = 2 * radius + side / chart.columns + side / chart.visible.shape[-1]
    return [
        f"the passage at ({place}) is too narrow for the chart of pursuer and evader: "
        f"they {detour_text}. This arena's chart resolves {resolution:.2f} m, so widen it to that."
    ]


def _flood_seeds(
    chart: Chart, cell: float, shape: tuple[int, ...]
) -> tuple[Int[np.ndarray, " seeds"], Int[np.ndarray, " seeds"]]:
    """Return the hubs of a chart of one arena that have a path to another, and the raster's cell
    where each is.

    Args:
        chart: the chart; without hubs, its coarse cells stand for them.
        cell: side of the raster's cells [m].
        shape: rows and columns of the raster.
    """
    lengths = np.asarray(chart.lengths)[0]
    if chart.hubs is None:
        hubs = cells = np.arange(chart.columns**2)
    else:
        cells = np.flatnonzero(np.asarray(chart.hubs.length)[0, :, 0] == 0)
        hubs = np.asarray(chart.hubs.number)[0, cells, 0].astype(int)
    other_lengths = np.where(np.eye(len(lengths), dtype=bool), NO_PATH, lengths)
    has_path = other_lengths.min(axis=1)[hubs] < NO_PATH
    hubs, cells = hubs[has_path], cells[has_path]
    indices = np.divmod(cells, chart.columns)
    middles = [(np.array(index) + 0.5) * float(chart.coarse_cell) / cell for index in indices]
    rows, columns = (middle.astype(int) for middle in middles)
    inside = (rows < shape[0]) & (columns < shape[1])
    return hubs[inside], (rows * shape[1] + columns)[inside]


def _links(
    clearance: Float[np.ndarray, "rows columns"], cell: float
) -> tuple[
    csr_array, Int[np.ndarray, " links"], Int[np.ndarray, " links"], Float[np.ndarray, " links"]
]:
    """Return neighbouring cells between which a robot surely fits, as a graph and as lists of ends
    and lengths [m].

    A line between the middles of two cells is free if it is no longer than the sum of the body's
    clearances there [m].
    """
    number = np.arange(clearance.size).reshape(clearance.shape)
    starts = []
    ends = []
    lengths = []
    for up, right in _STEPS:
        rows, columns = clearance.shape
        first = np.s_[: rows - up, max(0, -right) : columns - max(0, right)]
        second = np.s_[up:, max(0, right) : columns + min(0, right)]
        length = cell * np.hypot(up, right)
        is_free = (clearance[first] >= 0) & (clearance[second] >= 0)
        is_free &= clearance[first] + clearance[second] >= length
        starts.append(number[first][is_free])
        ends.append(number[second][is_free])
        lengths.append(np.full(int(is_free.sum()), length))
    start, end, length = (np.concatenate(parts) for parts in (starts, ends, lengths))
    return (
        csr_array((length, (start, end)), shape=(clearance.size, clearance.size)),
        start,
        end,
        length,
    )
