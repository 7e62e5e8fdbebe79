"""An arena as a graph of hexagonal cells: what one pursuer, and three, can do there does not hang on the cells."""

import numpy as np
import pytest

from apollonius.arenas.free_space import largest_part
from apollonius.arenas.tiling import tile
from apollonius.solve.cop_number import core

SIDE = 120
SPIRAL = np.zeros((SIDE, SIDE), bool)
"""A corridor of 6 places that winds inwards, with walls of 4."""
for number in range(6):
    low, high = 10 * number, SIDE - 10 * number
    SPIRAL[low : low + 6, max(0, low - 10) : high] = True
    SPIRAL[low:high, high - 6 : high] = True
    SPIRAL[high - 6 : high, low:high] = True
    SPIRAL[low + 10 : high, low : low + 6] = True
ROOM = np.ones((SIDE, SIDE), bool)
BENT = ROOM.copy()
BENT[30:, 40:70] = False
y, x = np.mgrid[:SIDE, :SIDE] - SIDE / 2
ANNULUS = (np.hypot(x, y) < 55) & (np.hypot(x, y) > 25)


def tiled(free, spacing, angle):
    return tile(largest_part(free, 0.0, 0.0, 1.0), spacing, angle)


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 6])
@pytest.mark.parametrize("spacing", [7.0, 11.0, 25.0])
@pytest.mark.parametrize("free", [ROOM, BENT, SPIRAL], ids=["room", "bent room", "spiral"])
def test_without_islands_one_pursuer_is_enough_whatever_the_cells(free, spacing, angle):
    tiling = tiled(free, spacing, angle)
    assert tiling.holes == 0
    assert len(core(tiling.adjacency)) == 1


@pytest.mark.parametrize("angle", [0.0, np.pi / 6])
@pytest.mark.parametrize("spacing", [6.0, 12.0])
def test_the_core_round_an_island_is_a_cycle(spacing, angle):
    tiling = tiled(ANNULUS, spacing, angle)
    kept = core(tiling.adjacency)
    assert tiling.holes == 1
    assert len(kept) >= 2 * np.pi * 25 / spacing
    assert (tiling.adjacency[np.ix_(kept, kept)].sum(axis=1) == 2).all()


def test_neighbours_are_next_to_each_other_and_places_are_free():
    tiling = tiled(ANNULUS, 8.0, 0.3)
    one, other = np.nonzero(tiling.adjacency)
    assert np.hypot(*(tiling.places[one] - tiling.places[other]).T).max() < 1.7 * 8
    column, row = np.floor(tiling.places).astype(int).T
    assert ANNULUS[row, column].all()
    assert not tiling.adjacency.diagonal().any()
    assert (tiling.adjacency == tiling.adjacency.T).all()
    count = len(tiling.places)
    assert count == pytest.approx(ANNULUS.sum() / (8.0**2 * np.sqrt(3) / 2), rel=0.35)
    assert tiling.adjacency.sum() / 2 <= 3 * count - 6  # as in every planar graph


def test_a_thin_wall_through_a_cell_parts_it():
    free = ROOM.copy()
    free[:, 60] = False
    free[:3, 60] = True
    tiling = tiled(free, 40.0, 0.0)
    assert tiling.holes == 0
    across = [
        (tiling.places[i], tiling.places[j])
        for i, j in np.argwhere(np.triu(tiling.adjacency))
        if (tiling.places[i][0] < 60) != (tiling.places[j][0] < 60)
    ]
    assert all(min(one[1], other[1]) < 40 for one, other in across)
