"""Walls (Eq. 2), discs, polygons and occupancy maps: clearance and contact, against dense sampling and oracles."""

from contextlib import nullcontext
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.arena import Arena, Disc
from apollonius.game.game import Game
from apollonius.game.obstacle import between_nodes
from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.game.polygon import Polygon
from apollonius.io.errors import InvalidInput
from tests.acting import robot
from tests.oracle.numpy_game import gaps

SQUARE = ((1.0, 1.0), (3.0, 1.0), (3.0, 3.0), (1.0, 3.0))
STAR = ((5.0, 1.0), (6.0, 4.0), (9.0, 5.0), (6.0, 6.0), (5.0, 9.0), (4.0, 6.0), (1.0, 5.0), (4.0, 4.0))
HALL = ((2.0, 2.0), (8.0, 2.0), (8.0, 8.0), (2.0, 8.0), (2.0, 5.5), (3.0, 5.5), (3.0, 7.0), (7.0, 7.0), (7.0, 3.0),
        (3.0, 3.0), (3.0, 4.5), (2.0, 4.5))  # fmt: skip
"""A room with walls of 1 m and a door of 1 m in the west."""
clearances = jax.jit(jax.vmap(lambda polygon, x, y: polygon.clearance(x, y), in_axes=(None, 0, 0)))
along = jax.jit(jax.vmap(lambda polygon, *ends: polygon.clearance_along(*ends), in_axes=(None, 0, 0)))


def robots(points):
    return jax.vmap(lambda place: robot(*place))(jnp.asarray(points))


@pytest.mark.parametrize("vertices", [STAR, STAR[::-1]])
def test_a_polygons_clearance_is_the_distance_to_its_boundary(vertices):
    from matplotlib.path import Path

    corners = np.asarray(vertices)
    share = np.linspace(0, 1, 1000, endpoint=False)[:, None, None]
    boundary = (corners + share * (np.roll(corners, -1, axis=0) - corners)).reshape(-1, 2)
    points = np.random.default_rng(0).uniform(0, 10, (300, 2)).astype(np.float32)
    distance = np.linalg.norm(points[:, None] - boundary, axis=-1).min(axis=1)
    inside = Path(corners).contains_points(points)
    assert 5 < inside.sum() < 295
    np.testing.assert_allclose(
        clearances(Polygon(vertices), *points.T), np.where(inside, -distance, distance), atol=1e-2
    )


def test_contact_along_a_step_is_that_of_the_oracle():
    rng = np.random.default_rng(1)
    before = rng.uniform(0, 10, (150, 2)).astype(np.float32)
    after = (before + rng.normal(0, 1.0, (150, 2))).astype(np.float32)
    arena = Arena(polygons=(Polygon(HALL),))
    ours = np.asarray(along(Polygon(HALL), robots(before), robots(after)))
    theirs = np.array([gaps(arena, 0.0, (*one, 0, 0), (*two, 0, 0))[0] for one, two in zip(before, after, strict=True)])
    clear_cut = np.abs(theirs) > 1e-4
    np.testing.assert_array_equal((ours < 0)[clear_cut], (theirs < 0)[clear_cut])
    outside = theirs > 1e-4
    assert 20 < outside.sum() < 145
    np.testing.assert_allclose(ours[outside], theirs[outside], atol=1e-4)


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
def test_the_edges_of_a_playable_polygon_meet_nowhere_but_at_the_corners_that_they_share(corners, meet):
    with pytest.raises(InvalidInput, match="edges meet nowhere else") if meet else nullcontext():
        Polygon(tuple((float(x), float(y)) for x, y in corners)).check("polygon", Arena())


def test_a_game_can_be_made_while_a_function_is_traced():
    """Numbers that are swept are not known then, and are left unchecked."""
    game = Game(arena=Arena(polygons=(Polygon(SQUARE),)))
    swept = jax.jit(jax.vmap(lambda dt: 3.0 * replace(game, dt=dt).dt))(jnp.asarray([0.5, 0.25]))
    assert swept.tolist() == [1.5, 0.75]


ARENA = Arena(-1.0, 3.0, 0.0, 2.0, discs=(Disc(0.0, 1.0, 0.25), Disc(2.0, 0.5, 0.3)))
leaves = jax.jit(Arena.is_out_of_range)


def test_clearance_is_the_distance_to_the_nearest_boundary_point():
    angles = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    rims = [(disc.x + disc.radius * np.cos(angles), disc.y + disc.radius * np.sin(angles)) for disc in ARENA.discs]
    along_x, along_y = np.linspace(-1, 3, 4000), np.linspace(0, 2, 4000)
    walls = [(along_x, 0 * along_x), (along_x, 0 * along_x + 2), (0 * along_y - 1, along_y), (0 * along_y + 3, along_y)]
    boundary = np.concatenate([np.stack(curve, axis=-1) for curve in (*rims, *walls)])

    points = np.random.default_rng(0).uniform((-1, 0), (3, 2), (200, 2)).astype(np.float32)
    to_boundary = np.linalg.norm(points[:, None] - boundary, axis=-1).min(axis=1)
    inside = np.any([np.hypot(*(points - (disc.x, disc.y)).T) < disc.radius for disc in ARENA.discs], axis=0)
    assert 10 < inside.sum() < 100
    np.testing.assert_allclose(clearances(ARENA, *points.T), np.where(inside, -to_boundary, to_boundary), atol=1e-3)


@pytest.mark.parametrize("radius", [0.0, 0.25])
@pytest.mark.parametrize(
    ("wall", "outwards"), [((-1, 1), (-1, 0)), ((3, 1), (1, 0)), ((1, 0), (0, -1)), ((1, 2), (0, 1))]
)
def test_a_wall_may_be_touched_but_not_passed(wall, outwards, radius):
    touching = np.subtract(wall, np.multiply(radius, outwards))
    assert not leaves(ARENA, robot(*touching), radius)
    assert leaves(ARENA, robot(*(touching + np.multiply(1e-6, outwards))), radius)


CELL = 0.25


def map_of(occupied, x=-1.0, y=2.0):
    return OccupancyMap(jnp.asarray(distance_field(occupied, CELL)), x, y, CELL, "none.yaml", "")


def to_occupied(occupied, points):
    """Distance of points [cells] from the nearest occupied square: by all squares."""
    rows, columns = np.nonzero(occupied)
    away_x = np.maximum(np.abs(points[:, :1] - columns - 0.5) - 0.5, 0)
    away_y = np.maximum(np.abs(points[:, 1:] - rows - 0.5) - 0.5, 0)
    return np.hypot(away_x, away_y).min(axis=1)


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
    ours = np.asarray(along(world, robots(points * CELL), robots(ends * CELL))) / CELL
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
