"""Paths over large floors: hubs against the shortest paths of the whole graph, and doors in a hall of 40 m."""

import functools
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from apollonius.arenas.charting import with_chart
from apollonius.arenas.hubs import HUBS, NEAREST, paths_by_hubs
from apollonius.arenas.random_arena import random_arena
from apollonius.arenas.survey import missed_passage
from apollonius.game.arena import Arena
from apollonius.game.chart import LARGE_COARSE, NO_PATH
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_arenas

STEPS = ((1, 0), (0, 1), (1, 1), (-1, 1))
CELL = 0.2
"""The side of a cell [m]."""


def steps_between(free):
    """Which cells of a floor are entered by each of `STEPS`."""
    rows, columns = free.shape
    wide = np.pad(free, 1)
    return np.stack([free & wide[1 - up : 1 - up + rows, 1 - right : 1 - right + columns] for right, up in STEPS])


def graph_of(free):
    """The same floor as a graph of all its cells, with lengths in metres."""
    columns = free.shape[1]
    ends = [np.flatnonzero(entered) for entered in steps_between(free)]
    starts = [end - up * columns - right for end, (right, up) in zip(ends, STEPS, strict=True)]
    lengths = [np.full(len(end), CELL * np.hypot(*step)) for end, step in zip(ends, STEPS, strict=True)]
    edges = np.concatenate(starts), np.concatenate(ends)
    return csr_array((np.concatenate(lengths), edges), shape=(free.size, free.size))


def over_hubs(tables, starts):
    """Lengths [m] of the paths from some cells to all, by way of hubs."""
    lengths, numbers, away = (table.astype(float) for table in tables)
    numbers = numbers.astype(int)
    to_hubs = np.min(away[starts][:, :, None] + lengths[numbers[starts]], axis=1)
    found = np.min(away[None] + to_hubs[:, numbers], axis=2) / 100
    return np.where(found >= NO_PATH / 100, np.inf, found)


@functools.cache
def cluttered():
    rng = np.random.default_rng(3)
    free = rng.random((70, 90)) > 0.15
    free[:, 45] = False  # a wall with one door, and a closed room
    free[30, 45] = True
    free[50:60, 60:75] = True
    free[[50, 59], 60:75] = free[50:60, [60]] = free[50:60, [74]] = False
    return free, paths_by_hubs(steps_between(free), STEPS, CELL)


def test_paths_over_hubs_are_little_longer_than_the_shortest_ones():
    free, tables = cluttered()
    starts = np.random.default_rng(0).choice(np.flatnonzero(free), 50, replace=False)
    true = dijkstra(graph_of(free), directed=False, indices=starts)
    found = over_hubs(tables, starts)
    far = np.isfinite(true) & (true > 2.0)
    np.testing.assert_array_equal(np.isfinite(found)[:, free.ravel()], np.isfinite(true)[:, free.ravel()])
    assert np.isinf(true[:, free.ravel()]).any(), "some of the floor is a closed room"
    excess = found[far] - true[far]
    assert excess.min() > -0.05, "rounded to centimetres"
    assert excess.mean() < 0.3
    assert excess.max() < 1.5


def test_nearest_hubs_come_first_and_their_ways_are_the_shortest():
    free, (lengths, numbers, away) = cluttered()
    count = int((lengths[np.arange(HUBS), np.arange(HUBS)] == 0).sum())
    assert 50 < count < HUBS
    cells = np.flatnonzero((away[:, 0] == 0) & free.ravel())
    hubs = numbers[cells, 0]
    assert sorted(hubs) == list(range(count)), "each hub stands in one cell"
    true = dijkstra(graph_of(free), directed=False, indices=cells[np.argsort(hubs)])
    known = away < NO_PATH
    assert (known.sum(axis=1)[free.ravel()] > 0).mean() > 0.95, "all but lonely cells"
    assert known.sum(axis=1).max() == NEAREST
    rows, ranks = np.nonzero(known)
    np.testing.assert_allclose(away[rows, ranks] / 100, true[numbers[rows, ranks], rows], atol=0.006)
    assert (np.diff(away.astype(int), axis=1) >= 0).all()


def test_closed_floor_has_no_hubs():
    lengths, _, away = paths_by_hubs(np.zeros((4, 8, 8), bool), STEPS, CELL)
    assert (lengths == NO_PATH).all()
    assert (away == NO_PATH).all()


@functools.cache
def hall(door):
    """A hall of 40 by 24 m, parted by a wall with a door of this width at its middle."""
    body = Unicycle(radius=0.18)
    walls = tuple(
        Polygon(((20.0, low), (20.15, low), (20.15, high), (20.0, high)))
        for low, high in ((0.0, 12 - door / 2), (12 + door / 2, 24.0))
    )
    arena = Arena(x_max=40.0, y_max=24.0, polygons=walls)
    return with_chart(Game(pursuer=body, evader=body, capture_distance=0.6, arena=arena))


def length(chart, start, end):
    points = [jnp.float32(number) for number in (*start, *end)]
    return float(chart.shortest_path_length(*points))


def test_path_in_a_large_hall_leads_through_a_door_as_narrow_as_the_robot():
    chart = hall(0.8).chart
    assert chart.columns == LARGE_COARSE
    there = length(chart, (10.0, 2.0), (30.0, 3.0))
    shortest = np.hypot(10, 10) + 0.15 + np.hypot(10, 9)
    assert shortest - 0.5 < there < 1.06 * shortest + 0.3
    assert length(chart, (30.0, 3.0), (10.0, 2.0)) == pytest.approx(there, abs=0.3)
    assert length(chart, (2.0, 2.0), (9.0, 9.0)) == pytest.approx(np.hypot(7, 7), abs=1e-3), "in sight"
    lengths = np.asarray(chart.lengths_from(jnp.float32(10.0), jnp.float32(2.0)))
    row, column = int(3.0 / 40 * LARGE_COARSE), int(30.0 / 40 * LARGE_COARSE)
    assert lengths[row, column] == pytest.approx(there, abs=0.4)
    assert np.isinf(lengths[-1, 0]), "outside the hall"


def test_door_narrower_than_the_robot_is_closed():
    assert np.isinf(length(hall(0.3).chart, (10.0, 2.0), (30.0, 3.0)))


def test_large_halls_in_one_game_have_their_own_hubs():
    halls = hall(0.8), hall(0.3)
    together = with_chart(in_arenas(halls[0], [one.arena for one in halls])).chart
    for member, one in enumerate(halls):
        own = replace(together, member=jnp.int32(member))
        for start, end in (((10.0, 2.0), (30.0, 3.0)), ((2.0, 20.0), (18.0, 3.0))):
            assert length(own, start, end) == pytest.approx(length(one.chart, start, end), rel=1e-6)


def test_survey_of_a_large_hall_finds_no_missed_passage():
    assert missed_passage(hall(0.8)) == []
    open_plan = hall(0.8)
    parted = np.asarray(open_plan.chart.lengths).copy()
    parted[0, 0, :] = parted[0, :, 0] = NO_PATH
    parted[0, 0, 1] = 100  # a hub without any path counts as closed in
    broken = replace(open_plan, chart=replace(open_plan.chart, lengths=jnp.asarray(parted)))
    (note,) = missed_passage(broken)
    assert "know no other way" in note
    assert "resolves 0.59 m" in note


def test_buildings_have_rooms_off_corridors_and_doors_of_their_width():
    arena = random_arena("buildings", 1, gap=0.9, width=30.0, height=20.0)
    corners = np.array([polygon.vertices for polygon in arena.polygons])
    sizes = corners.max(axis=1) - corners.min(axis=1)
    assert (sizes > 0).all()
    assert corners.min() >= 0.0
    assert (corners.max(axis=(0, 1)) == (30.0, 20.0)).all()
    assert 20 < (sizes.min(axis=1) < 0.16).sum() < 200, "walls"
    assert (sizes.min(axis=1) > 0.35).sum() > 20, "furniture"
    assert arena == random_arena("buildings", 1, gap=0.9, width=30.0, height=20.0)
