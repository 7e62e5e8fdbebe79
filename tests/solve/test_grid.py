"""The grid, its image after a hold, and the least time to a target: against SciPy and brute force."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.types import RobotState, Role
from apollonius.io.errors import InvalidInput
from apollonius.solve.grid import make_grid
from apollonius.solve.motion import HORIZON, motion_of
from apollonius.solve.reach import solve_reach
from apollonius.solve.solving import joint_grid, reference_grid
from apollonius.solve.transition_map import of_courses, transition_map_of
from tests.oracle import numpy_solver as oracle
from tests.solve.small import BODY, SMALL, TINY, as_table

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


def test_it_is_the_least_clearance_along_the_hold():
    """Among discs and polygons, for every 31st node and action."""
    corner = Polygon(((0.0, 1.0), (1.2, 1.0), (1.2, 1.4), (0.4, 1.4), (0.4, 2.6), (0.0, 2.6)))
    game = replace(SMALL, arena=replace(SMALL.arena, polygons=(corner,)))
    motion, grid = motion_of(game, Role.PURSUER, 5), make_grid(game.arena, BODY, TINY)
    found = np.asarray(of_courses(motion.clearance, grid, transition_map_of(motion, grid)))
    found = found.reshape(*grid.shape[:2], 9, *grid.shape[2:])
    nodes = list(oracle.nodes(oracle.axes(game, TINY)).items())
    pairs = []
    for number in range(0, 9 * len(nodes), 31):
        (x, y, v, heading), state = nodes[number // 9]
        expected = oracle.clearance_along(game, oracle.course(game, state, number % 9, 5))
        pairs.append((found[v, heading, number % 9, x, y], expected))
    ours, theirs = np.array(pairs).T
    free = theirs > 1e-4
    assert 0.2 < free.mean() < 0.8
    np.testing.assert_allclose(ours[free], theirs[free], atol=1e-5)
    assert np.all(ours[theirs < -1e-4] < 0)


def test_on_the_reference_grid_a_hold_moves_by_whole_speeds_and_almost_whole_headings():
    odd = Game(pursuer=Unicycle(v_min=0.1, v_max=1.03, u1_max=0.0, u2_max=0.0), dt=0.7)
    assert reference_grid(odd, Role.PURSUER)[1] == 1
    wide, hold = reference_grid(Game(arena=Arena(x_max=200.0), dt=0.01), Role.PURSUER)
    assert (wide.counts[:2], hold) == ((101, 51), 50)
    grid, hold = reference_grid(make_game("paper"), Role.PURSUER)
    assert (grid.counts, hold) == ((51, 51, 9, 47), 5)
    assert reference_grid(make_game("paper"), Role.PURSUER, coarse=True)[0].counts == (26, 26, 9, 16)
    transitions = transition_map_of(motion_of(make_game("paper"), Role.PURSUER, hold), grid)
    assert transitions.source.shape[-1] == 2
    assert np.all(np.max(np.asarray(transitions.weight), axis=-1) > 0.99)


@pytest.mark.parametrize(
    ("game", "counts", "hold"),
    [
        (Game(), (17, 17, 5, 8), 10),
        (Game(pursuer=Unicycle(v_min=0.4), arena=Arena(x_max=20.0)), (20, 10, 5, 11), 7),
        (Game(pursuer=Unicycle(u1_max=0.05, u2_max=0.1)), (12, 12, 5, 16), 20),
    ],
    ids=["paper", "longer and never at rest", "slow to change"],
)
def test_on_the_grid_of_two_a_hold_moves_the_pursuer_by_one_speed_and_about_one_heading(game, counts, hold):
    """From 0 to 1.2 m/s in four speeds of 0.3 m/s^2 x 1 s; 0.8 rad of 2 pi are an eighth; nodes as far apart along x as
    along y; 2 s at most and 16 headings."""
    for role in Role:
        grid, steps = joint_grid(game, role)
        assert (grid.counts, steps) == (counts, hold)


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
    assert math.isinf(float(jax.jit(lambda robot: reach.seconds(robot))(outside)))


@pytest.mark.parametrize("target", [(0.7, 2.3), (3.0, 1.0)], ids=["in a disc", "beyond the walls"])
def test_a_target_that_cannot_stand_there_is_refused(target):
    with pytest.raises(InvalidInput, match=r"target = \("):
        solve_reach(SMALL, SMALL_GRID, HOLD, target)
