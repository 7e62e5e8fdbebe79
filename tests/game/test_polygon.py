"""Polygons: distances and contacts against dense sampling and an oracle that was written apart."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from apollonius.game.arena import Arena
from apollonius.game.game import Game
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
def test_clearance_is_the_distance_to_the_nearest_boundary_point(vertices):
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


coordinate = st.integers(1, 99).map(lambda number: number / 10)


@given(st.lists(st.tuples(coordinate, coordinate), min_size=3, max_size=6))
def test_the_corners_of_a_playable_polygon_are_in_order_and_its_edges_meet_nowhere_else(corners):
    """Against the definition, in whole numbers: no two edges share a point but neighbours the corner between them."""
    whole = [(round(10 * x), round(10 * y)) for x, y in corners]
    simple = is_simple(whole)
    try:
        Polygon(tuple(corners)).check("polygon", Arena())
    except InvalidInput as refusal:
        assume("edges meet nowhere else" in str(refusal))
        assert not simple
    else:
        assert simple


def is_simple(corners):
    edges = [(corners[i], corners[(i + 1) % len(corners)]) for i in range(len(corners))]

    def turn(a, b, c):
        return np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

    def on(a, b, c):
        return (
            turn(a, b, c) == 0
            and min(a[0], b[0]) <= c[0] <= max(a[0], b[0])
            and (min(a[1], b[1]) <= c[1] <= max(a[1], b[1]))
        )

    for i, (a, b) in enumerate(edges):
        for j, (c, d) in enumerate(edges):
            if a == b or (i != j and c not in (a, b) and on(a, b, c)) or (i != j and a == c):
                return False
            if (i + 1) % len(edges) == j and on(a, b, d):
                return False
            if turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0:
                return False
    return True


@pytest.mark.parametrize(
    ("vertices", "said"),
    [
        (SQUARE[:2], "2 corners is not possible: it must be 3 to 1000"),
        (((1.0, 1.0), (3.0, 3.0), (3.0, 1.0), (1.0, 3.0)), "edges meet nowhere else"),
        (((1.0, 1.0), (3.0, 1.0), (2.0, 1.0)), "edges meet nowhere else"),
        (((1.0, 1.0), (3.0, 1.0), (3.0, 11.0)), r"\(3, 11\) .* inside the walls .* move"),
        (((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)), "no place to start"),
        (((1.0, math.inf), (3.0, 1.0), (3.0, 11.0)), "finite number"),
    ],
)
def test_impossible_polygons_are_refused_in_one_line(vertices, said):
    with pytest.raises(InvalidInput, match=said) as refusal:
        Game(arena=Arena(polygons=(Polygon(vertices),)))
    assert len(str(refusal.value).splitlines()) == 1


def test_a_game_can_be_made_while_a_function_is_traced():
    game = Game(arena=Arena(polygons=(Polygon(SQUARE),)))
    assert float(jax.jit(lambda factor: factor * replace(game, dt=0.5).dt)(jnp.float32(3.0))) == 1.5
