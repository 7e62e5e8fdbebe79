"""Walls (Eq. 2), discs, polygons and occupancy maps: clearance and contact, against dense sampling and oracles."""

from contextlib import nullcontext
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.arena import Arena, Disc
from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.game.polygon import Polygon
from apollonius.io.errors import InvalidInput
from tests.acting import clearances, robot
from tests.oracle.numpy_game import gaps, meets

STAR = ((5.0, 1.0), (6.0, 4.0), (9.0, 5.0), (6.0, 6.0), (5.0, 9.0), (4.0, 6.0), (1.0, 5.0), (4.0, 4.0))
HALL = ((2.0, 2.0), (8.0, 2.0), (8.0, 8.0), (2.0, 8.0), (2.0, 5.5), (3.0, 5.5), (3.0, 7.0), (7.0, 7.0), (7.0, 3.0),
        (3.0, 3.0), (3.0, 4.5), (2.0, 4.5))  # fmt: skip
"""A room with walls of 1 m and a door of 1 m in the west."""
ARENA = Arena(-1.0, 11.0, 0.0, 10.5, discs=(Disc(0.0, 1.0, 0.25), Disc(9.0, 8.5, 0.7)), polygons=(Polygon(HALL),))
WIDE = Arena(-99.0, 99.0, -99.0, 99.0)
along = jax.jit(jax.vmap(lambda one, *ends: one.clearance_along(*ends), in_axes=(None, 0, 0)))
hidden = jax.jit(jax.vmap(lambda one, *ends: one.hides(*ends), in_axes=(None, 0, 0)))


def robots(points):
    return jax.vmap(lambda place: robot(*place))(jnp.asarray(points))


@pytest.mark.parametrize(
    ("one", "arena"),
    [(ARENA, ARENA), *((star, replace(WIDE, polygons=(star,))) for star in (Polygon(STAR), Polygon(STAR[::-1])))],
    ids=["arena", "star", "star the other way round"],
)
def test_clearance_contact_and_occlusion_match_the_oracle(one, arena):
    """Of what touches the inside only that it does."""
    rng = np.random.default_rng(1)
    before = rng.uniform((-1, 0), (11, 10), (200, 2)).astype(np.float32)
    after = (before + rng.normal(0, 1.0, (200, 2))).astype(np.float32)
    there = np.array([gaps(arena, 0.0, place, place) for place in before.tolist()])
    assert 9 < (there < 0).any(axis=1).sum() < 190
    np.testing.assert_allclose(clearances(one, *before.T), there.min(axis=1), atol=1e-5)
    steps = np.array([gaps(arena, 0.0, *ends) for ends in zip(before.tolist(), after.tolist(), strict=True)])
    least = np.minimum(steps.min(axis=1), there[:, 1])
    ours = np.asarray(along(one, robots(before), robots(after)))
    clear_cut = (np.abs(steps) > 1e-4).all(axis=1)
    np.testing.assert_array_equal((ours < 0)[clear_cut], (least < 0)[clear_cut])
    outside = least > 1e-4
    assert 20 < outside.sum() < 180
    np.testing.assert_allclose(ours[outside], least[outside], atol=1e-5)
    np.testing.assert_array_equal(hidden(one, robots(before), robots(after))[clear_cut], steps[clear_cut, 0] < 0)


@pytest.mark.parametrize(
    ("corners", "meet"),
    [
        (STAR, False), (STAR[::-1], False), (HALL, False),
        (((1, 1), (2, 1), (3, 1), (1, 3)), False),  # a corner in the middle of a side
        (((1, 1), (3, 3), (3, 1), (1, 3)), True),  # edges cross
        (((1, 1), (5, 1), (5, 3), (3, 1), (1, 3)), True),  # a corner on another edge, and beyond its line's ends
        (((1, 1), (5, 1), (5, 3), (3, 1.01), (1, 3)), False),
        (((1, 1), (3, 1), (2, 2), (3, 3), (1, 3), (2, 2)), True),  # two corners at one place
        (((1, 1), (3, 1), (3, 1), (1, 3)), True),  # an edge without a length
        (((1, 1), (5, 1), (3, 1)), True), (((5, 1), (1, 1), (3, 1), (5, 3)), True),  # there and back
    ],
)  # fmt: skip
def test_polygons_whose_edges_meet_beyond_shared_corners_are_refused(corners, meet):
    with pytest.raises(InvalidInput, match="edges meet nowhere else") if meet else nullcontext():
        Polygon(tuple((float(x), float(y)) for x, y in corners)).check("polygon", Arena())


BOX = Arena(-1.0, 3.0, 0.0, 2.0)
leaves = jax.jit(Arena.is_out_of_range)


@pytest.mark.parametrize("radius", [0.0, 0.25])
@pytest.mark.parametrize(
    ("wall", "outwards"), [((-1, 1), (-1, 0)), ((3, 1), (1, 0)), ((1, 0), (0, -1)), ((1, 2), (0, 1))]
)
def test_wall_may_be_touched_but_not_passed(wall, outwards, radius):
    touching = np.subtract(wall, np.multiply(radius, outwards))
    assert not leaves(BOX, robot(*touching), radius)
    assert leaves(BOX, robot(*(touching + np.multiply(1e-6, outwards))), radius)


CELL = 0.25


def map_of(occupied, x=-1.0, y=2.0):
    return OccupancyMap(jnp.asarray(distance_field(occupied, CELL)), x, y, CELL, "none.yaml", "")


def to_occupied(occupied, points):
    """Distance of points [cells] from the nearest occupied square: by all squares."""
    rows, columns = np.nonzero(occupied)
    away_x = np.maximum(np.abs(points[:, :1] - columns - 0.5) - 0.5, 0)
    away_y = np.maximum(np.abs(points[:, 1:] - rows - 0.5) - 0.5, 0)
    return np.hypot(away_x, away_y).min(axis=1)


def test_map_clearance_is_just_below_the_true_distance():
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


def test_map_cells_hide_what_squares_hide():
    world = map_of(np.random.default_rng(2).random((24, 30)) < 0.08)
    ends = np.random.default_rng(1).uniform((0, 0), (30, 24), (800, 2))
    ends = np.stack([ends, np.clip(ends + np.random.default_rng(3).uniform(-16, 16, ends.shape), 0, (30, 24))])
    squares = [((x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)) for y, x in np.argwhere(world.occupied()).tolist()]
    expected = [any(meets(square, *pair) for square in squares) for pair in np.moveaxis(ends, 0, 1).tolist()]
    assert 40 < sum(expected) < 760
    found = hidden(world, *(robots(places * CELL + (-1, 2)) for places in ends))
    np.testing.assert_array_equal(found, expected)


def test_map_clearance_along_a_step_is_a_tight_lower_bound():
    rng = np.random.default_rng(4)
    occupied = rng.random((40, 40)) < 0.05
    points = rng.uniform(0, 40, (500, 2))
    ends = np.clip(points + rng.normal(0, 1, (500, 2)), 0, 40)
    length = np.hypot(*(ends - points).T)
    world = map_of(occupied, 0.0, 0.0)
    ours = np.asarray(along(world, robots(points * CELL), robots(ends * CELL))) / CELL
    dense = [points + share * (ends - points) for share in np.linspace(0, 1, 201)]
    least = np.min([to_occupied(occupied, places) for places in dense], axis=0)
    field = np.min([clearances(world, *(places * CELL).T.astype(np.float32)) for places in dense], axis=0) / CELL
    touches = least == 0
    assert 50 < touches.sum() < 450
    assert np.all(ours[touches] < 0)
    assert np.all(ours[~touches] <= least[~touches] + 1e-3)
    assert np.all(ours >= field - length / 8 - 1e-3)


def test_empty_map_has_no_obstacles_and_a_full_map_is_refused():
    empty = map_of(np.zeros((10, 10), bool), 0.0, 0.0)
    assert float(empty.clearance(*jnp.asarray([1.0, 1.0]))) > 2
    with pytest.raises(ValueError, match="free cells"):
        distance_field(np.ones((10, 10), bool), CELL)
