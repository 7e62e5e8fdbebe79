"""Occupancy maps as obstacles: never nearer than the field says, and no way through what is occupied."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.obstacle import between_nodes
from apollonius.game.occupancy import OccupancyMap, distance_field
from tests.acting import robot

CELL = 0.25


def map_of(occupied, x=-1.0, y=2.0):
    return OccupancyMap(jnp.asarray(distance_field(occupied, CELL)), x, y, CELL, "none.yaml", "")


def to_occupied(occupied, points):
    """Distance of points [cells] from the nearest occupied square: by all squares."""
    rows, columns = np.nonzero(occupied)
    away_x = np.maximum(np.abs(points[:, :1] - columns - 0.5) - 0.5, 0)
    away_y = np.maximum(np.abs(points[:, 1:] - rows - 0.5) - 0.5, 0)
    return np.hypot(away_x, away_y).min(axis=1)


clearances = jax.jit(jax.vmap(OccupancyMap.clearance, in_axes=(None, 0, 0)))
along = jax.jit(jax.vmap(lambda world, *ends: world.clearance_along(robot(*ends[:2]), robot(*ends[2:])),
                         in_axes=(None, 0, 0, 0, 0)))  # fmt: skip


def test_a_clearance_is_at_most_the_distance_and_little_less():
    """Over random cells: lone ones, and blocks of them."""
    rng = np.random.default_rng(100)
    occupied = rng.random((40, 60)) < 0.1
    occupied[10:13, 20:45] = occupied[5:30, 50:52] = True
    points = rng.uniform((0, 0), (60, 40), (20_000, 2))
    ours = np.asarray(clearances(map_of(occupied), *(points * CELL + (-1, 2)).T.astype(np.float32))) / CELL
    within = occupied[points[:, 1].astype(int), points[:, 0].astype(int)]
    true = to_occupied(occupied, points)
    assert 0.03 < within.mean() < 0.5
    assert np.all(ours[within] < -0.14)
    short = (true - ours)[~within]
    assert short.min() > -1e-3
    assert short.max() < 0.86
    assert short.min() < 0.02


@pytest.mark.parametrize(
    ("position", "corner", "share"), [(2.25, 2, 0.25), (0.0, 0, 0.0), (4.0, 3, 1.0), (7.3, 3, 1.0), (-2.0, 0, 0.0)]
)
def test_a_place_is_between_two_of_five_corners_and_beyond_them_at_the_ends(position, corner, share):
    before, on_the_way = between_nodes(jnp.float32(position), 5)
    assert (int(before), float(on_the_way)) == (corner, share)


def test_along_a_step_it_is_at_most_the_least_distance_and_short_by_an_eighth_of_the_step():
    rng = np.random.default_rng(4)
    occupied = rng.random((40, 40)) < 0.05
    points = rng.uniform(0, 40, (500, 2))
    ends = np.clip(points + rng.normal(0, 1, (500, 2)), 0, 40)
    length = np.hypot(*(ends - points).T)
    world = map_of(occupied, 0.0, 0.0)
    ours = np.asarray(along(world, *(np.hstack([points, ends]) * CELL).T.astype(np.float32))) / CELL
    dense = [points + share * (ends - points) for share in np.linspace(0, 1, 201)]
    least = np.min([to_occupied(occupied, places) for places in dense], axis=0)
    field = np.min([clearances(world, *(places * CELL).T.astype(np.float32)) for places in dense], axis=0) / CELL
    touches = least == 0
    assert 50 < touches.sum() < 450
    assert np.all(ours[touches] < 0)
    assert np.all(ours[~touches] <= least[~touches] + 1e-3)
    assert np.all(ours >= field - length / 8 - 1e-3)


def test_a_map_without_occupied_cells_has_no_obstacles_and_one_without_free_cells_is_refused():
    empty = map_of(np.zeros((10, 10), bool), 0.0, 0.0)
    assert float(empty.clearance(*jnp.asarray([1.0, 1.0]))) > 2
    with pytest.raises(ValueError, match="free cells"):
        distance_field(np.ones((10, 10), bool), CELL)
