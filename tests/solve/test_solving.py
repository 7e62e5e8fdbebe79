"""Grids, safety and times to a target against SciPy and brute force, files of solutions, players of solved games."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from apollonius.agents.wrappers.shield import Shielded
from apollonius.arenas.file import to_dict
from apollonius.catalogue import find_player
from apollonius.evaluate.solved import describe_solution
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, sample_starts
from apollonius.game.presets import make_game
from apollonius.game.types import RobotState, Role
from apollonius.io.errors import InvalidInput
from apollonius.solve import transition_map
from apollonius.solve.grid import TOLERANCE, iterate_values, make_grid
from apollonius.solve.motion import HORIZON, motion_of
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.reach import solve_reach
from apollonius.solve.safety import solve_safety
from apollonius.solve.solving import (
    cached_tables,
    joint_grid,
    joint_problem,
    reference_grid,
    solve_problem,
    zero_sum_game_of,
)
from apollonius.solve.store import Problem, Solution, load_solution, save_solution
from apollonius.solve.transition_map import transition_map_of
from tests.oracle import numpy_solver as oracle
from tests.solve.small import BODY, CRAMPED, FEW, HOLD, SMALL, TINY

SMALL_GRID = make_grid(SMALL.arena, BODY, TINY)


@pytest.fixture(scope="module")
def robot():
    """That of the small game, by plain loops."""
    return oracle.Robot(SMALL, TINY, HOLD)


def test_safety_table_matches_brute_force(robot):
    """Each sweep goes down, and the last moves nothing."""
    told = []
    solved = solve_safety(SMALL, Role.PURSUER, SMALL_GRID, HOLD, told.append)
    expected = oracle.safety(SMALL, robot, solved.sweeps)
    np.testing.assert_allclose(solved.table, expected, atol=2e-6)
    assert 0.1 < np.mean(expected > 0) < 0.9
    assert [sweep.number for sweep in told] == list(range(1, solved.sweeps + 1))
    assert told[-1].residual == solved.residual == 0 < told[0].residual
    shares = [sweep.share for sweep in told]
    assert (shares[0], shares[-1]) == (0, 1)
    assert 0 < shares[1] < 1


def test_safety_sweeps_converge_for_a_robot_that_cannot_stop():
    """Where there is room it may circle at 0.1 / 0.8 = 0.125 m for ever."""
    game = replace(CRAMPED, pursuer=Unicycle(v_min=0.1, v_max=0.4))
    solved = solve_safety(game, Role.PURSUER, make_grid(game.arena, game.pursuer, (12, 9, 2, 12)), HOLD)
    assert 0 < solved.residual <= TOLERANCE
    assert 0.05 < np.mean(np.asarray(solved.table) < 0) < 0.3


def test_starts_with_negative_values_count_as_lost():
    problem = Problem("safety", "evader", to_dict(SMALL), [2, 2, 2, 4], 5)
    for metres, lost in ((-0.1, 1.0), (0.0, 0.0)):
        facts = describe_solution(Solution(problem, 1, 0.0, jnp.full((2, 4, 2, 2), metres, jnp.float32)), SMALL)
        assert (facts["grid"], facts["hold [s]"], facts["moving starts lost, by the table"]) == ("2x2x2x4", 0.5, lost)


def test_impossible_grids_and_targets_are_refused():
    too_large = (10_001, 10_001, 101, 101), r"grid = 10001x10001x101x101 needs .* GiB .* fewer nodes"
    for counts, said in (too_large, *((counts, "grid = ") for counts in ((10, 10, 9), (1, 10, 9, 47), (10, 10, 9, 2)))):
        with pytest.raises(InvalidInput, match=said):
            solve_safety(SMALL, Role.PURSUER, make_grid(SMALL.arena, BODY, counts), HOLD)
    for target in ((0.7, 2.3), (3.0, 1.0)):  # in a disc, and beyond the walls
        with pytest.raises(InvalidInput, match=r"target = \("):
            solve_reach(SMALL, SMALL_GRID, HOLD, target)


def test_sweeps_end_at_a_limit_that_tolerates_a_small_residual(monkeypatch):
    monkeypatch.setattr("apollonius.solve.grid._MOST_SWEEPS", 4)
    told = []
    found = iterate_values(lambda table: (table, jnp.asarray(1e-5)), jnp.zeros(()), told.append, tolerance=0.0)
    assert [sweep.number for sweep in told] == [1, 2, 3, 4]
    assert found.sweeps == 4
    with pytest.raises(RuntimeError, match="after 4 sweeps"):
        iterate_values(lambda table: (table, jnp.asarray(1e-3)), jnp.zeros(()), tolerance=0.0)


PROBLEM = Problem("game", "evader", to_dict(SMALL), [3, 4, 2, 4], 5, whole_cells=True)

REACH = Solution(
    Problem("reach", "pursuer", to_dict(SMALL), [4, 3, 2, 5], 5, [0.5, 1.0]), 12, 3e-5,
    jnp.arange(120, dtype=jnp.float32).reshape(2, 5, 4, 3),
)  # fmt: skip


SOLUTION = Solution(
    PROBLEM, 12, 3e-5, jnp.asarray(np.random.default_rng(0).uniform(-1, 1, (2, 96, 48)).astype(np.float16))
)
"""Of any values that a table may have."""


@pytest.fixture
def file(tmp_path):
    save_solution(SOLUTION, tmp_path / "solved.safetensors")
    return tmp_path / "solved.safetensors"


def test_saved_solution_loads_unchanged_and_plays(file, monkeypatch):
    found = load_solution(file)
    np.testing.assert_array_equal(found.table, SOLUTION.table)
    assert (found.problem, found.sweeps, found.residual) == (PROBLEM, 12, 3e-5)
    player = find_player(str(file), Role.EVADER, SMALL)
    assert player.name == "solved"
    expected = SaddlePolicy(zero_sum_game_of(PROBLEM, SMALL), SOLUTION.table)
    starts = sample_starts(SMALL, jax.random.key(0), 20)
    np.testing.assert_array_equal(player.policy.best_value(starts), expected.best_value(starts))
    monkeypatch.setattr("apollonius.evaluate.solved.STARTS", 20)
    sure, facts = np.asarray(expected.best_value(starts)), describe_solution(SOLUTION, SMALL)
    assert [*facts.values()][-3:] == pytest.approx([np.mean(sure), np.max(sure), np.min(sure)], abs=1e-6)
    other = replace(SMALL, max_steps=77, starts=replace(SMALL.starts, speed="moving"))
    assert find_player(str(file), Role.EVADER, other).policy.zero_sum_game.game.max_steps == 77
    found = find_player(f"shielded:{file}", Role.EVADER, SMALL)
    assert found.name == "shielded:solved"
    assert isinstance(found.policy, Shielded)


def test_solution_of_another_side_game_or_kind_is_refused(file, tmp_path):
    reach, none = tmp_path / "reach.safetensors", tmp_path / "none.safetensors"
    save_solution(REACH, reach)
    another = rf"pursuer = '{file}'.*solved for the pursuer; this is the evader's"
    for path, role, game, said in (
        (file, Role.PURSUER, SMALL, another),
        (file, Role.EVADER, replace(SMALL, dt=0.2), "solved for another game"),
        (none, Role.EVADER, SMALL, "there is no agent file"),
        (reach, Role.PURSUER, SMALL, "this is one of reach"),
    ):
        with pytest.raises(InvalidInput, match=said):
            find_player(str(path), role, game)


@pytest.mark.parametrize("role", Role)
def test_whole_cells_solution_has_values_of_whole_numbers_of_steps(role):
    """Every value is that of a game that ends after a number of steps, and the last sweep changed none."""
    problem = replace(joint_problem(CRAMPED, role, (4, 3, 3, 8)), hold=10, whole_cells=True)
    solution = solve_problem(problem, CRAMPED)
    assert solution.residual == 0
    values = np.abs(np.asarray(solution.table, np.float64))
    steps = -HORIZON / CRAMPED.dt * np.log(values[values > 0])
    assert len(np.unique(np.round(steps))) > 5
    np.testing.assert_allclose(steps, np.round(steps), atol=0.2)
    with pytest.raises(InvalidInput, match=r"whole_cells = true.*left out for all but game"):
        replace(problem, kind="safety")


def test_cached_tables_are_solved_once_per_problem(monkeypatch, tmp_path):
    """Time limit and rewards are nothing to a table, the capture distance is; a damaged file is solved again."""
    solved = []

    def solve(problem, game, report):
        solved.append(problem)
        return Solution(problem, 1, 0.0, jnp.full((2, 120, 60), len(solved), jnp.float16))

    monkeypatch.setattr("apollonius.solve.solving.solve_problem", solve)
    first, again = (cached_tables(CRAMPED, FEW, tmp_path) for _ in range(2))
    assert solved == [joint_problem(CRAMPED, role, FEW) for role in Role]
    assert sorted(path.name.split("-")[0] for path in tmp_path.iterdir()) == ["evader", "pursuer"]
    for role in Role:
        problem = joint_problem(CRAMPED, role, FEW)
        assert first[role].zero_sum_game == again[role].zero_sum_game == zero_sum_game_of(problem, CRAMPED)
        np.testing.assert_array_equal(first[role].table, again[role].table)
    longer = replace(CRAMPED, max_steps=7, reward=replace(CRAMPED.reward, progress=1.0))
    assert cached_tables(longer, FEW, tmp_path).pursuer.zero_sum_game.game == longer
    assert len(solved) == 2
    for path in tmp_path.iterdir():
        path.write_bytes(path.read_bytes()[:-1])
    cached_tables(CRAMPED, FEW, tmp_path)
    assert len(solved) == 4
    cached_tables(replace(CRAMPED, capture_distance=0.2), FEW, tmp_path)
    assert len(solved) == 6
    cached_tables(CRAMPED, FEW, None)
    assert len(solved) == 8


def test_interpolation_is_multilinear_and_clamped_at_the_ends():
    """By SciPy, on a table in which the first heading is there again at the end."""
    grid, random = make_grid(SMALL.arena, BODY, (6, 7, 3, 8)), np.random.default_rng(0)
    table = random.normal(size=grid.shape).astype(np.float32)
    axes = [np.linspace(0, 0.6, 3), np.arange(9) * 2 * np.pi / 8, np.linspace(-1, 2, 6), np.linspace(0, 4, 7)]
    v, heading, x, y = random.uniform([-0.1, -np.pi, -1.5, -0.5], [0.7, np.pi, 2.5, 4.5], (1000, 4)).T
    within = np.stack([np.clip(v, 0, 0.6), heading % (2 * np.pi), np.clip(x, -1, 2), np.clip(y, 0, 4)], axis=-1)
    expected = RegularGridInterpolator(axes, np.concatenate([table, table[:, :1]], axis=1))(within)
    states = jax.vmap(RobotState)(*(jnp.asarray(numbers, jnp.float32) for numbers in (x, y, v, heading)))
    found = jax.jit(jax.vmap(grid.interpolate, (None, 0)))(table, states)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert jnp.all(jax.vmap(grid.corners)(states)[0] < grid.size)


def test_memory_estimate_of_a_hold_bounds_and_scales_with_its_course():
    motion, grid = motion_of(SMALL, Role.PURSUER, 5), reference_grid(SMALL, Role.PURSUER)[0]
    course = transition_map_of(motion, grid).course
    courses = sum(leaf.nbytes for leaf in jax.tree.leaves(course))
    asked = transition_map._bytes_of_hold(motion, grid)
    assert courses < asked < 100 * courses
    longer = transition_map._bytes_of_hold(replace(motion, steps=10), grid)
    assert 1.5 < longer / asked < 2


def test_reference_grid_nearly_aligns_with_one_hold():
    odd = Game(pursuer=Unicycle(v_min=0.1, v_max=1.03, u1_max=0.0, u2_max=0.0), dt=0.7)
    assert reference_grid(odd, Role.PURSUER)[1] == 1
    wide, hold = reference_grid(Game(arena=Arena(x_max=200.0, y_max=10.1), dt=0.01), Role.PURSUER)
    assert (wide.counts[:2], hold) == ((101, 52), 50)
    grid, hold = reference_grid(make_game("paper"), Role.PURSUER)
    assert (grid.counts, hold) == ((51, 51, 9, 47), 5)
    transitions = transition_map_of(motion_of(make_game("paper"), Role.PURSUER, hold), grid)
    assert transitions.source.shape[-1] == 2
    assert np.all(np.max(np.asarray(transitions.weight), axis=-1) > 0.99)


def test_joint_grid_has_the_expected_nodes_and_hold():
    """From 0 to 1.2 m/s in four speeds of 0.3 m/s^2 x 1 s; 0.8 rad of 2 pi are an eighth; nodes as far apart along x as
    along y; 2 s at most and 16 headings."""
    slow_to_change = Game(pursuer=Unicycle(u1_max=0.05, u2_max=0.1))
    for game, counts, hold in (
        (Game(), (17, 17, 5, 8), 10),
        (Game(pursuer=Unicycle(v_min=0.4), arena=Arena(x_max=20.0)), (20, 10, 5, 11), 7),
        (slow_to_change, (12, 12, 5, 16), 20),
    ):
        for role in Role:
            grid, steps = joint_grid(game, role)
            assert (grid.counts, steps) == (counts, hold)


def test_reach_table_matches_brute_force(robot):
    target, told = (1.3, 3.1), []
    reach, solved = solve_reach(SMALL, SMALL_GRID, HOLD, target, told.append)
    assert len(told) == solved.sweeps
    assert solved.residual < 1e-4 < told[-2].residual
    expected = oracle.reach(SMALL, robot, solved.sweeps, target, HORIZON)
    np.testing.assert_allclose(reach.table, expected, atol=1e-6)
    assert 0.1 < np.mean(expected > 0.5) < 0.95
    assert np.any(expected == 0)
    outside = [(2.95, 1.0, 0.6, 0.0)]
    states = jax.vmap(RobotState)(*jnp.asarray([*robot.states, *outside], jnp.float32).T)
    values, seconds = jax.jit(jax.vmap(lambda state: (reach.action_values(state), reach.seconds(state))))(states)
    known = np.append(reach.table, 0.0)
    np.testing.assert_allclose(values.max(axis=1)[known > 0], known[known > 0], atol=1e-4)
    assert math.isinf(seconds[-1])
