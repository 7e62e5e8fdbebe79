"""What is within reach, from an index, against a look at everything."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.accelerate import nearby
from apollonius.game.arena import Arena
from apollonius.game.near_edges import near_edges
from apollonius.game.packed_arena import stacked_edges
from apollonius.game.polygon import Edges, Polygon
from apollonius.game.scenario import Scenario
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
ARENAS = [
    Arena(-3.0, 13.0, -4.0, 12.0, polygons=(Polygon(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))),)),
    Arena(-3.0, 13.0, -4.0, 12.0, polygons=INDEXED),
    Arena(0.0, 5.0, 0.0, 30.0),
]


@pytest.mark.parametrize("length", [0.0, 0.7])
def test_indexed_clearance_matches_all_polygons_within_reach(length):
    """From points, and from segments, among them those that are nearest to a polygon at neither of their ends."""
    walls = Scenario.of(ARENAS).arenas
    indexed, everything = near_edges(stacked_edges(ARENAS), walls, REACH), Edges.of(INDEXED)
    within, count = indexed.index.within, sum(len(polygon.vertices) for polygon in INDEXED)
    assert within.shape == (3, 64, 64, 16)
    lengths = (within < 3 * count).sum(axis=3).max(axis=(1, 2))
    np.testing.assert_array_equal(lengths, [3, len(HALL), 0])
    rng = np.random.default_rng(5)
    starts, angle = rng.uniform((-2, -3), (12, 11), (6000, 2)), rng.uniform(-np.pi, np.pi, 6000)
    ends = robots(starts), robots(starts + length * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    near = np.asarray(along(eqx.tree_at(lambda edges: edges.member, indexed, 1), *ends))
    every = np.asarray(along(everything, *ends))
    reach = REACH - length / 2
    within = every <= reach
    at_ends = np.minimum(*(clearances(everything, end.x, end.y) for end in ends))
    assert length == 0 or (within & (every < at_ends - 0.01 * length)).sum() > 15
    assert (every < 0).sum() > 50
    assert 500 < within.sum() < 5900
    np.testing.assert_allclose(near, np.minimum(every, reach), atol=3e-5)


def test_index_has_fewer_cells_where_its_lists_are_long(monkeypatch):
    """Three things are near everywhere in both squares."""
    monkeypatch.setattr(nearby, "_MOST", 1_000)
    squares = [np.zeros(2), np.zeros(2), np.ones(2)]
    index = nearby.index_nearby(lambda _, x, y: np.zeros((3, len(y), len(x))), 1.0, *squares)
    assert index.within.shape == (2, 4, 4, 8)
    np.testing.assert_array_equal(index.near(1, jnp.float32(0.5), jnp.float32(9.0)), [3, 4, 5, 6, 6, 6, 6, 6])
