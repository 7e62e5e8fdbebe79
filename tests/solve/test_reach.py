"""Reach: the least time to a target against brute force, against closed forms, and in play."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.types import RobotState
from apollonius.io.errors import InvalidInput
from apollonius.solve.grid import make_grid
from apollonius.solve.motion import HORIZON
from apollonius.solve.reach import solve_reach
from tests.oracle import numpy_solver as oracle
from tests.solve.small import BODY, SMALL, TINY, as_table

TARGET = (1.3, 3.1)
SMALL_GRID = make_grid(SMALL.arena, BODY, TINY)
HOLD = 5


def test_the_table_is_that_of_brute_force():
    told = []
    reach, solved = solve_reach(SMALL, SMALL_GRID, HOLD, TARGET, told.append)
    assert len(told) == solved.sweeps
    assert solved.residual < 1e-4 < told[-2].residual
    expected = as_table(oracle.reach(SMALL, TINY, HOLD, solved.sweeps, TARGET, HORIZON), TINY)
    np.testing.assert_allclose(reach.table, expected, atol=1e-6)
    assert 0.1 < np.mean(expected > 0.5) < 0.95
    assert np.any(expected == 0)
    nodes = map(jnp.asarray, np.unravel_index(np.arange(SMALL_GRID.size), SMALL_GRID.shape))
    values = jax.jit(jax.vmap(reach.action_values))(jax.vmap(SMALL_GRID.node)(*nodes))
    known = np.ravel(reach.table)
    np.testing.assert_allclose(values.max(axis=1)[known > 0], known[known > 0], atol=1e-4)
    outside = RobotState(*(jnp.float32(number) for number in (2.95, 1.0, 0.6, 0.0)))
    assert math.isinf(float(jax.jit(reach.seconds)(outside)))


@pytest.mark.parametrize("target", [(0.7, 2.3), (3.0, 1.0)], ids=["in a disc", "beyond the walls"])
def test_a_target_that_cannot_stand_there_is_refused(target):
    with pytest.raises(InvalidInput, match=r"target = \("):
        solve_reach(SMALL, SMALL_GRID, HOLD, target)
