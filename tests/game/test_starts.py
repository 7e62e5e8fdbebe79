"""Where games begin: room around each robot and between them, and nothing else that would favour a place."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from apollonius.game.arena import Arena, Disc
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.starts import Starts

ARENA = Arena(discs=(Disc(5.0, 5.0, 1.0),))
PURSUER, EVADER = Unicycle(v_min=0.2, v_max=1.0, radius=0.1), Unicycle(v_min=-0.5, v_max=2.0, radius=0.4)
DRAWS = 10_000


@jax.jit
def sample(starts, key):
    bodies = BySide((PURSUER,), (EVADER,))
    return jax.vmap(starts.sample, in_axes=(0, None, None))(jax.random.split(key, DRAWS), ARENA, bodies)


@pytest.fixture(scope="module")
def near():
    """Robots that may start at the same place: their positions are independent."""
    return sample(Starts(clearance=0.3, separation=0.0), jax.random.key(0))


@pytest.fixture(scope="module")
def apart():
    return sample(Starts(clearance=0.3, separation=5.0), jax.random.key(1))


@pytest.fixture(scope="module")
def moving():
    return sample(Starts(speed="moving"), jax.random.key(2))


def is_uniform(values, low, high, bins=50):
    counts, _ = np.histogram(values, bins, (low, high))
    return counts.sum() == len(values) and stats.chisquare(counts).pvalue > 1e-3


@pytest.mark.parametrize("short", [0, 1, 2])
def test_what_is_asked_for_is_enough_and_less_is_not(short):
    """Along the lower wall, in quarters of a metre, so that nothing is rounded: of either robot and between them."""
    starts, body = Starts(clearance=0.5, separation=2.0), Unicycle(radius=0.25)
    places = [1.0, 0.75, 3.0, 0.75]
    assert bool(starts.fits(ARENA, body, body, *map(jnp.float32, places)))
    places[short] += [0.25, -0.25, -0.25][short]
    assert not bool(starts.fits(ARENA, body, body, *map(jnp.float32, places)))
    places[:] = [1.0, 0.75, 3.0, 0.75 - 2**-20]
    assert not bool(starts.fits(ARENA, body, body, *map(jnp.float32, places)))


def test_pairs_are_uniform_over_all_pairs_that_fit(apart):
    """The distribution of pairs that a simple rejection in NumPy leaves: compared by place and by distance."""
    places = np.random.default_rng(0).uniform(0, 10, (200_000, 2, 2))
    to_wall = np.minimum(places, 10 - places).min(axis=-1)
    room = np.minimum(to_wall, np.linalg.norm(places - 5, axis=-1) - 1)
    fits = (room >= [0.4, 0.7]).all(axis=-1) & (np.linalg.norm(places[:, 0] - places[:, 1], axis=-1) >= 5)
    expected = places[fits]
    ours = np.moveaxis(
        np.array([[apart.pursuer.x, apart.pursuer.y], [apart.evader.x, apart.evader.y]]), -1, 0
    )  # [draws, robot, axis], as `expected`
    for measure in (
        lambda pairs: pairs[:, 0, 0],
        lambda pairs: pairs[:, 1, 1],
        lambda pairs: np.linalg.norm(pairs - 5, axis=-1)[:, 0],
        lambda pairs: np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=-1),
    ):
        assert stats.ks_2samp(measure(ours), measure(expected)).pvalue > 1e-3


@pytest.mark.parametrize("role", ["pursuer", "evader"])
def test_headings_are_uniform_over_the_circle(near, role):
    assert is_uniform(getattr(near, role).heading, -np.pi, np.pi)


def test_at_rest_a_robot_has_speed_zero_or_the_slowest_it_can_go(near):
    assert np.all(near.pursuer.v == np.float32(0.2))
    assert np.all(near.evader.v == 0)


def test_moving_speeds_are_uniform_between_each_robots_own_limits(moving):
    assert is_uniform(moving.pursuer.v, 0.2, 1.0)
    assert is_uniform(moving.evader.v, -0.5, 2.0)
