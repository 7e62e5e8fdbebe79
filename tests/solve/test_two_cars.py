"""The two-robot solver against the game of two cars: the same captures as in relative coordinates."""

import math
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.starts import Starts
from apollonius.game.types import Role
from apollonius.solve.grid import make_grid
from apollonius.solve.joint import make_duel, solve_duel, value_before_move
from apollonius.solve.motion import HORIZON, make_zero_sum_game
from tests.oracle.numpy_air3d import Cars, least_distance
from tests.solve.small import as_matrix

pytestmark = pytest.mark.slow
CAPTURE = 5.0
"""Capture distance [m], and the radius of the faster car's circle: equal, as in Mitchell, Bayen and Tomlin (2005)."""
SECONDS = HORIZON * math.log(2)
"""A capture after so long is worth half of one at once: what is worth more is captured sooner."""
STEPS, HOLDS = 3, 3
"""Steps of the game in a hold, and of the oracle; holds until `SECONDS`."""
SIZE, PLACES, HEADINGS = 12.25, 15, 12
"""The arena is a square from -SIZE to SIZE [m], with walls too far to matter; nodes across it, and headings."""
CELL, TURN = 2 * SIZE / (PLACES - 1), math.tau / HEADINGS * HOLDS / SECONDS
"""In a hold a car turns by one cell of headings."""
SPEEDS = {"both fast": (1, 1), "both slow": (0, 0), "faster pursuer": (1, 0), "faster evader": (0, 1)}
"""Whether the pursuer and the evader go at the higher of two speeds, one half of the other."""
FAST = CAPTURE * TURN
FINER = 4
"""Cells of the oracle in one of the grid's."""


@pytest.fixture(scope="module", params=list(Role), ids=["lower", "upper"])
def capture_bounds(request):
    """Where captures are certain by the lower value, and by the upper: by the pursuer's speed, psi, x and y, and the
    evader's speed, who is in the middle and looks along x.

    A car keeps the speed that it has, so that one table holds four games. Sweeps go on until none adds what is worth as
    much as a capture at the end of the horizon.
    """
    car = Unicycle(v_min=FAST / 2, v_max=FAST, u1_max=0.0, u2_max=TURN)
    arena, starts = Arena(-SIZE, SIZE, -SIZE, SIZE), Starts(clearance=0.0, separation=CAPTURE)
    game = Game(car, car, arena, CAPTURE, SECONDS / HOLDS / STEPS, starts=starts)
    grid = make_grid(arena, car, (PLACES, PLACES, 2, HEADINGS))
    duel = make_duel(make_zero_sum_game(game, (grid, grid), STEPS, request.param))
    solved = solve_duel(duel, tolerance=0.5)
    assert solved.sweeps >= HOLDS
    matrix, middle = np.asarray(as_matrix(value_before_move(duel, solved.table))), PLACES // 2
    evaders = np.ravel_multi_index((np.array([0, 1]), 0, middle, middle), grid.shape)
    values = matrix[:, evaders] if request.param == Role.PURSUER else -matrix[evaders].T
    return values.reshape(*grid.shape, 2) > 0.5


@cache
def truth(name):
    """The same for two speeds by the oracle: psi, x and y, in cells of its own, and farther."""
    pursuer, evader = (FAST / (2 - speed) for speed in SPEEDS[name])
    cells = max(math.ceil((CAPTURE + 2 * FAST * SECONDS) / CELL), PLACES // 2)
    cars = Cars(pursuer, evader, TURN, CAPTURE)
    return least_distance(cars, cells * CELL, 2 * cells * FINER + 1, STEPS * HEADINGS, SECONDS)[::STEPS] < 0


def cells_apart(capture_bounds, played, other):
    """By how many cells, at most, what is found for two speeds goes beyond the truth for others, or falls short."""
    pursuer, evader = SPEEDS[played]
    capture_bounds, expected = capture_bounds[pursuer, ..., evader], truth(other)
    outside = (expected.shape[1] // FINER + 1 - PLACES) // 2 * FINER
    inside = (slice(None), *(slice(outside, expected.shape[1] - outside, FINER),) * 2)
    return max(
        np.max(np.stack([distance_transform_edt(psi) for psi in away])[inside] * wrong, initial=0) / FINER
        for away, wrong in (
            (~expected, capture_bounds & ~expected[inside]),
            (expected, ~capture_bounds & expected[inside]),
        )
    )


@pytest.mark.parametrize("speeds", SPEEDS)
def test_solver_matches_the_game_of_two_cars_to_within_a_cell(capture_bounds, speeds):
    assert cells_apart(capture_bounds, speeds, speeds) <= 1


@pytest.mark.parametrize("other", ["faster pursuer", "faster evader"])
def test_solver_differs_from_other_speeds_by_more_than_a_cell(capture_bounds, other):
    assert cells_apart(capture_bounds, "both fast", other) > 1
