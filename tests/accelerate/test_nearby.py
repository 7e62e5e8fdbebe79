"""What is within reach, from an index, against a look at everything."""

import jax
import numpy as np
import pytest

from apollonius.agents.wrappers.shield import index_polygons
from apollonius.game.polygon import Edges, Polygon
from tests.acting import clearances
from tests.game.test_obstacles import HALL, along, robots

REACH = 1.5
INDEXED = (
    Polygon(HALL),
    Polygon(((10.8, -3.0), (12.0, -2.8), (11.1, -2.7), (11.0, -1.8))),  # with a dent
    Polygon(((10.7, 10.5), (10.7, 11.8), (12.4, 11.8), (12.4, 10.5))),  # clockwise
    Polygon(((-1.6, 10.8), (-1.5, 10.8), (-1.55, 10.9))),
)
"""Nowhere are two of these in reach."""


@pytest.mark.parametrize("length", [0.0, 0.7])
def test_indexed_clearance_matches_all_polygons_within_reach(length):
    """From points, and from segments, among them those that are nearest to a polygon at neither of their ends."""
    index, everything = index_polygons(INDEXED, REACH, (-3.0, 13.0), (-4.0, 12.0)), Edges.of(INDEXED)
    assert index.within.shape == (64, 64, 16)
    assert (index.within < sum(len(polygon.vertices) for polygon in INDEXED)).sum(axis=2).max() == len(HALL) == 12
    rng = np.random.default_rng(5)
    starts, angle = rng.uniform((-2, -3), (12, 11), (6000, 2)), rng.uniform(-np.pi, np.pi, 6000)
    ends = robots(starts), robots(starts + length * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    one = lambda before, after: Edges(index.near(before.x, before.y)).clearance_along(before, after)  # noqa: E731
    near, every = np.asarray(jax.jit(jax.vmap(one))(*ends)), np.asarray(along(everything, *ends))
    within = every <= REACH - length
    at_ends = np.minimum(*(clearances(everything, end.x, end.y) for end in ends))
    assert length == 0 or (within & (every < at_ends - 0.01 * length)).sum() > 15
    assert (every < 0).sum() > 50
    assert 500 < within.sum() < 5900
    np.testing.assert_allclose(near[within], every[within], atol=3e-5)
    assert (near[~within] > REACH - length).all()
    assert (near[every > 2 * REACH] > 1e5).any(), "where none is in reach"
