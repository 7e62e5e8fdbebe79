"""The polygons near a robot: what is left out is out of reach, and what is near is measured as among all of them."""

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.game.nearby import surroundings
from apollonius.game.polygon import Polygon, Polygons
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
INDEX = surroundings(POLYGONS, REACH, LEFT, LEFT + SIZE, LOWER, LOWER + SIZE)


@jax.vmap
def at(x, y):
    zero = jnp.zeros_like(x)
    return RobotState(x, y, zero, zero)


def test_a_point_is_as_far_from_what_is_near_as_from_all_up_to_the_reach():
    x, y = jnp.asarray(RNG.uniform((LEFT, LOWER), (LEFT + SIZE, LOWER + SIZE), (4000, 2)), jnp.float32).T
    near = jax.jit(jax.vmap(lambda x, y: INDEX.near(x, y).clearance_from(x, y)))(x, y)
    every = np.asarray(jax.jit(jax.vmap(Polygons(POLYGONS).clearance))(x, y))
    within = every <= REACH
    assert (every < 0).sum() > 50
    assert 1000 < within.sum() < 3900
    np.testing.assert_allclose(np.asarray(near)[within], every[within], atol=3e-5)
    assert (np.asarray(near)[~within] > REACH).all()


def test_a_way_is_as_clear_of_what_is_near_as_of_all():
    """Ways that begin outside, among them those whose nearest point is neither of their ends. Where a way begins is not
    looked at again: it is where another one ended."""
    x, y = RNG.uniform((LEFT + 1, LOWER + 1), (LEFT + SIZE - 1, LOWER + SIZE - 1), (12_000, 2)).astype(np.float32).T
    length = 0.7
    angle = RNG.uniform(-np.pi, np.pi, 12_000)
    before = at(*map(jnp.asarray, (x, y)))
    after = at(*(jnp.asarray(end, jnp.float32) for end in (x + length * np.cos(angle), y + length * np.sin(angle))))
    one = lambda before, after: INDEX.near(before.x, before.y).clearance_along(before, after)  # noqa: E731
    near = np.asarray(jax.jit(jax.vmap(one))(before, after))
    all_of_them = Polygons(POLYGONS)
    every = np.asarray(jax.jit(jax.vmap(all_of_them.clearance_along))(before, after))
    first, last = (np.asarray(jax.jit(jax.vmap(all_of_them.clearance))(end.x, end.y)) for end in (before, after))
    told = (first > 0) & (every <= REACH - length)
    assert (told & (every < np.minimum(first, last) - 0.01 * length)).sum() > 15
    assert (told & (every < 0)).sum() > 10
    np.testing.assert_allclose(np.minimum(near, first)[told], every[told], atol=3e-5)


def test_only_some_are_looked_at_and_none_where_none_is_in_reach():
    assert INDEX.within.shape == (64, 64, 4)
    x, y = jnp.float32(LEFT + 15.5), jnp.float32(LOWER + 0.5)
    assert float(INDEX.near(x, y).clearance_from(x, y)) > 1e5
