"""The polygons near a robot: what is left out is out of reach, and what is near is measured as among all of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.nearby import surroundings
from apollonius.game.polygon import Edges, Polygon
from apollonius.game.types import RobotState

REACH, SIZE, LEFT, LOWER = 1.5, 16.0, 10.0, 30.0
"""Of the index; the side of its square and its lower left corner [m]. Cells are a quarter of a metre."""
RNG = np.random.default_rng(5)


def shape(at_x, at_y, *corners):
    return Polygon(tuple((LEFT + at_x + x, LOWER + at_y + y) for x, y in corners))


POLYGONS = (
    shape(3.0, 3.0, (0.0, 0.0), (4.5, 0.3), (4.4, 0.5), (0.0, 0.4)),  # long walls, along x and along y
    shape(11.0, 2.0, (0.0, 0.0), (0.3, 0.0), (0.7, 5.0), (0.4, 5.2)),
    shape(4.0, 8.0, (0.0, 0.0), (1.2, 0.2), (0.3, 0.3), (0.2, 1.2)),  # one with a dent, clockwise and the other way
    shape(8.0, 12.0, (0.0, 0.0), (0.0, 2.5), (2.5, 2.5), (2.5, 0.0)),
    shape(14.0, 13.0, (0.0, 0.0), (0.1, 0.0), (0.05, 0.1)),
)


@pytest.fixture(scope="module")
def index():
    return surroundings(POLYGONS, REACH, LEFT, LEFT + SIZE, LOWER, LOWER + SIZE)


@jax.vmap
def at(x, y):
    zero = jnp.zeros_like(x)
    return RobotState(x, y, zero, zero)


@pytest.mark.parametrize("length", [0.0, 0.7])
def test_what_is_near_is_as_far_away_as_among_all_polygons_up_to_the_reach(length, index):
    """From points, and from segments, among them those that are nearest to a polygon at neither of their ends."""
    x, y = RNG.uniform((LEFT + 1, LOWER + 1), (LEFT + SIZE - 1, LOWER + SIZE - 1), (6000, 2)).astype(np.float32).T
    angle = RNG.uniform(-np.pi, np.pi, 6000)
    ends = at(x, y), at(*np.float32((x + length * np.cos(angle), y + length * np.sin(angle))))
    everything = Edges.of(POLYGONS)
    one = lambda before, after: index.near(before.x, before.y).clearance_along(before, after)  # noqa: E731
    near, every = (np.asarray(jax.jit(jax.vmap(function))(*ends)) for function in (one, everything.clearance_along))
    within = every <= REACH - length
    at_ends = np.min([jax.jit(jax.vmap(everything.clearance))(end.x, end.y) for end in ends], axis=0)
    assert length == 0 or (within & (every < at_ends - 0.01 * length)).sum() > 15
    assert (every < 0).sum() > 50
    assert 500 < within.sum() < 5900
    np.testing.assert_allclose(near[within], every[within], atol=3e-5)
    assert (near[~within] > REACH - length).all()


def test_only_some_are_looked_at_and_none_where_none_is_in_reach(index):
    assert index.within.shape == (64, 64, 4)
    x, y = jnp.float32(LEFT + 15.5), jnp.float32(LOWER + 0.5)
    assert float(index.near(x, y).clearance(x, y)) > 1e5
