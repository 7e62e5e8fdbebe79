"""The game of two cars in an arena whose walls are too far to matter, and how far apart two capture sets are."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.starts import Starts
from apollonius.game.types import Role
from apollonius.solve.grid import make_grid
from apollonius.solve.joint import make_duel, solve_duel, value_before_move
from apollonius.solve.motion import HORIZON
from apollonius.solve.zero_sum_game import make_zero_sum_game
from tests.oracle.numpy_air3d import Cars, least_distance
from tests.solve.small import as_matrix

CAPTURE = 5.0
"""Capture distance [m], and the radius of the faster car's circle: equal, as in Mitchell, Bayen and Tomlin (2005)."""
SECONDS = HORIZON * math.log(2)
"""A capture after so long is worth half of one at once: what is worth more is captured sooner."""
STEPS = 3
"""Steps of the game in a hold, and of the oracle."""
SPEEDS = {"both fast": (1, 1), "both slow": (0, 0), "faster pursuer": (1, 0), "faster evader": (0, 1)}
"""Whether the pursuer and the evader go at the higher of two speeds."""
FINER = 4
"""Cells of the oracle in one of the grid's."""


@dataclass(frozen=True)
class Setting:
    """A square arena from -size to size [m] with so many nodes across (odd), headings, and holds until `SECONDS`.

    In a hold a car turns by one cell of headings. It has two speeds, one half of the other, and keeps the one it has: a
    table for both cars holds four games.
    """

    size: float
    places: int
    headings: int
    holds: int

    @property
    def cell(self):
        return 2 * self.size / (self.places - 1)

    @property
    def turn(self):
        return math.tau / self.headings * self.holds / SECONDS

    @property
    def game(self):
        fast = CAPTURE * self.turn
        car = Unicycle(v_min=fast / 2, v_max=fast, u1_max=0.0, u2_max=self.turn)
        arena = Arena(-self.size, self.size, -self.size, self.size)
        dt = SECONDS / self.holds / STEPS
        return Game(car, car, arena, CAPTURE, dt, starts=Starts(clearance=0.0, separation=CAPTURE))


def captured(setting, role, whole_cells=False):
    """Where capture is certain by one side's table: by the pursuer's speed, psi, x and y, and the evader's speed.

    The evader is in the middle and looks along x. Sweeps go on until none adds what is worth as much as a capture at
    the end of the horizon.
    """
    game, middle = setting.game, setting.places // 2
    counts = (setting.places, setting.places, 2, setting.headings)
    grid = make_grid(game.arena, game.pursuer, counts)
    duel = make_duel(make_zero_sum_game(game, (grid, grid), STEPS, role), whole_cells)
    found = solve_duel(duel, tolerance=0.5)
    assert found.sweeps >= setting.holds
    matrix = np.asarray(as_matrix(value_before_move(duel, found.table)))
    evaders = np.ravel_multi_index((np.array([0, 1]), 0, middle, middle), grid.shape)
    values = matrix[:, evaders] if role == Role.PURSUER else -matrix[evaders].T
    return values.reshape(*grid.shape, 2) > 0.5


def truth(setting, speeds, oracle=least_distance):
    """The same for the speeds of pursuer and evader by an oracle: psi, x and y, in cells of its own, and farther."""
    fast = CAPTURE * setting.turn
    pursuer, evader = (fast / (2 - speed) for speed in speeds)
    cells = max(math.ceil((CAPTURE + 2 * fast * SECONDS) / setting.cell), setting.places // 2)
    cars, size = Cars(pursuer, evader, setting.turn, CAPTURE), cells * setting.cell
    return oracle(cars, size, 2 * cells * FINER + 1, STEPS * setting.headings, SECONDS)[::STEPS] < 0


def cells_apart(setting, found, expected):
    """By how many cells, at most, the one set goes beyond the other: how much too large it is, and too small."""
    outside = (expected.shape[1] // FINER + 1 - setting.places) // 2 * FINER
    inside = (slice(None), *(slice(outside, expected.shape[1] - outside, FINER),) * 2)
    too_large, too_small = (
        np.max(np.stack([distance_transform_edt(psi) for psi in away])[inside] * wrong, initial=0) / FINER
        for away, wrong in ((~expected, found & ~expected[inside]), (expected, ~found & expected[inside]))
    )
    return float(too_large), float(too_small)
