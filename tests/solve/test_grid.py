"""The grid: where its nodes are, and the value between them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from apollonius.game.types import RobotState
from apollonius.io.errors import InvalidInput
from apollonius.solve.grid import make_grid
from tests.solve.small import BODY, SMALL

GRID = make_grid(SMALL.arena, BODY, (6, 7, 3, 8))
AXES = [np.linspace(0, 0.6, 3), np.arange(9) * 2 * np.pi / 8, np.linspace(-1, 2, 6), np.linspace(0, 4, 7)]
"""In a table's order, with the first heading again at the end."""
BETWEEN = jax.jit(jax.vmap(GRID.interpolate, (None, 0)))


def robots(rows):
    """States from rows of v, heading, x, y."""
    v, heading, x, y = jnp.asarray(rows, jnp.float32).T
    return jax.vmap(RobotState)(x, y, v, heading)


@pytest.fixture(scope="module")
def table():
    return np.random.default_rng(0).normal(size=GRID.shape).astype(np.float32)


def test_nodes_lie_from_end_to_end():
    index = [jnp.arange(count) for count in GRID.shape]
    nodes = jax.vmap(GRID.node)(*[jnp.asarray(axis.ravel()) for axis in jnp.meshgrid(*index, indexing="ij")])
    v, heading, x, y = (axis.ravel() for axis in np.meshgrid(AXES[0], AXES[1][:-1], *AXES[2:], indexing="ij"))
    for found, expected in zip((nodes.v, nodes.heading, nodes.x, nodes.y), (v, heading, x, y), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-6)
    np.testing.assert_allclose(GRID.places()[0], AXES[2], atol=1e-6)
    np.testing.assert_allclose(GRID.places()[1], AXES[3], atol=1e-6)
    assert GRID.size == nodes.x.size


def test_between_nodes_the_value_is_multilinear(table):
    rng = np.random.default_rng(1)
    rows = rng.uniform([0, -np.pi, -1, 0], [0.6, np.pi, 2, 4], (500, 4))
    around = np.concatenate([table, table[:, :1]], axis=1)
    expected = RegularGridInterpolator(AXES, around)(np.c_[rows[:, 0], rows[:, 1] % (2 * np.pi), rows[:, 2:]])
    found = BETWEEN(table, robots(rows))
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_beyond_the_ends_it_is_the_value_of_the_end(table):
    beyond = robots([[0.7, 0.3, -1.4, 4.2], [0.6, 0.3, -1.0, 4.0]])
    found = BETWEEN(table, beyond)
    assert found[0] == found[1]


@pytest.mark.parametrize("counts", [(10, 10, 9), (1, 10, 9, 47), (10, 10, 9, 2)])
def test_a_grid_without_cells_is_refused(counts):
    with pytest.raises(InvalidInput, match="grid = "):
        make_grid(SMALL.arena, BODY, counts)
