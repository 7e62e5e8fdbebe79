"""The image of a grid: a shift of slices is the same as going there node by node."""

from dataclasses import replace

import numpy as np
import pytest

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.solve.grid import make_grid
from apollonius.solve.motion import motion_of
from apollonius.solve.solving import joint_grid, reference_grid
from apollonius.solve.transition_map import of_courses, transition_map_of
from tests.oracle import numpy_solver as oracle
from tests.solve.small import BODY, SMALL, TINY


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
