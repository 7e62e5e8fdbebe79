"""Maps of what is solved say what the tables say, node by node."""

from math import exp

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.record import to_dict
from apollonius.game.presets import make_game
from apollonius.show.solution import _of_a_game, _of_reach, _of_safety, save_solution_maps
from apollonius.solve.grid import make_grid
from apollonius.solve.store import Problem, Solution
from tests.solve.small import as_matrix

GAME = make_game("one-large")
COUNTS = [5, 4, 3, 4]
GRID = make_grid(GAME.arena, GAME.pursuer, tuple(COUNTS))
FAST = float(GAME.pursuer.v_max)


def of(maps):
    """The two arrays of numbers."""
    return [numbers for _, _, numbers in maps]


def test_safety_counts_headings_at_full_speed_and_finds_the_highest_speed_that_is_safe_in_all():
    table = np.ones(GRID.shape, np.float32)
    table[2, :3, 0, 0] = -0.1  # at full speed three headings of four are lost
    table[1, 2, 1, 1] = -0.1  # half speed is lost in one direction; that full speed is not must not count
    table[:, 0, 2, 2] = -0.1  # even at rest
    headings, speeds = of(_of_safety(table, GRID))
    assert headings[0, 0] == 25
    assert headings[3, 3] == 100
    assert speeds[0, 0] == pytest.approx(FAST / 2)
    assert speeds[1, 1] == 0
    assert np.isnan(speeds[2, 2])
    assert speeds[3, 3] == pytest.approx(FAST)


def test_reach_gives_seconds_of_the_best_heading_and_counts_headings_at_full_speed():
    table = np.zeros(GRID.shape, np.float32)
    table[0, 1, 0, 0], table[0, 2, 0, 0] = exp(-3 / 20), exp(-5 / 20)
    table[2, 1, 0, 0] = 0.5
    seconds, headings = of(_of_reach(table, GRID))
    assert seconds[0, 0] == pytest.approx(3, abs=1e-4)
    assert np.isnan(seconds[1, 1])
    assert (headings[0, 0], headings[1, 1]) == (25, 0)


@pytest.mark.parametrize("role", ["pursuer", "evader"])
def test_a_game_is_drawn_as_its_table_has_it_in_tiles(role, tmp_path):
    """Against `as_matrix`, the other robot at the node that is free and nearest to the middle."""
    lanes = 16
    table = jax.random.uniform(jax.random.key(0), (GRID.size // lanes, GRID.size, lanes)).astype(jnp.float16)
    problem = Problem("game", role, to_dict(GAME), COUNTS, 10, payoff="win")
    solution = Solution(problem, 1, 0.0, table)
    free = np.ones((5, 4), bool)
    free[2] = False
    by_pairs = np.asarray(as_matrix(table), np.float32).T.reshape(*GRID.shape, *GRID.shape)  # own, then the other's
    here, mean = of(_of_a_game(solution, GRID, GRID, free))
    np.testing.assert_allclose(here, by_pairs[0, :, :, :, 0, 0, 1, 1].max(axis=0), rtol=1e-3)
    np.testing.assert_allclose(mean, by_pairs.mean(axis=(0, 1, 4, 5, 6, 7)), rtol=1e-3)
    save_solution_maps(solution, GAME, tmp_path / "game.png")
    assert (tmp_path / "game.png").read_bytes().startswith(b"\x89PNG")
