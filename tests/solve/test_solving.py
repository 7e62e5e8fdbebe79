"""Files of solutions, and the players of solved games."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.shield import Shielded
from apollonius.arenas.record import to_dict
from apollonius.catalogue import find_player
from apollonius.evaluate.solution import about
from apollonius.game.game import sample_starts
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput
from apollonius.solve.motion import HORIZON
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.solving import cached_tables, joint_problem, solve_problem, zero_sum_game_of
from apollonius.solve.store import Problem, Solution, load_solution, save_solution
from tests.solve.small import CRAMPED, FEW, SMALL

PROBLEM = Problem("game", "evader", to_dict(SMALL), [3, 4, 2, 4], 5, whole_cells=True)

REACH = Solution(
    Problem("reach", "pursuer", to_dict(SMALL), [4, 3, 2, 5], 5, [0.5, 1.0]), 12, 3e-5,
    jnp.arange(120, dtype=jnp.float32).reshape(2, 5, 4, 3),
)  # fmt: skip


@pytest.fixture(scope="module")
def solution():
    """Of any values that a table may have."""
    values = np.random.default_rng(0).uniform(-1, 1, (2, 96, 48)).astype(np.float16)
    return Solution(PROBLEM, 12, 3e-5, jnp.asarray(values))


@pytest.fixture
def file(tmp_path, solution):
    save_solution(solution, tmp_path / "solved.safetensors")
    return tmp_path / "solved.safetensors"


def test_a_solved_game_comes_back_as_it_went_and_plays(file, solution, monkeypatch):
    found = load_solution(file)
    np.testing.assert_array_equal(found.table, solution.table)
    assert (found.problem, found.sweeps, found.residual) == (PROBLEM, solution.sweeps, solution.residual)
    player = find_player(str(file), Role.EVADER, SMALL)
    assert player.name == "solved"
    expected = SaddlePolicy(zero_sum_game_of(PROBLEM, SMALL), solution.table)
    starts = sample_starts(SMALL, jax.random.key(0), 20)
    np.testing.assert_array_equal(player.policy.best_value(starts), expected.best_value(starts))
    monkeypatch.setattr("apollonius.evaluate.solution.STARTS", 20)
    sure, facts = np.asarray(expected.best_value(starts)), about(solution, SMALL)
    assert [*facts.values()][-3:] == pytest.approx([np.mean(sure), np.max(sure), np.min(sure)], abs=1e-6)
    other = replace(SMALL, max_steps=77, starts=replace(SMALL.starts, speed="moving"))
    assert find_player(str(file), Role.EVADER, other).policy.zero_sum_game.game.max_steps == 77
    found = find_player(f"shielded:{file}", Role.EVADER, SMALL)
    assert found.name == "shielded:solved"
    assert isinstance(found.policy, Shielded)


def test_a_file_of_something_else_is_refused(file, solution, tmp_path):
    with pytest.raises(
        InvalidInput, match=r"pursuer = '.*solved.safetensors'.*solved for the pursuer; this is the evader's"
    ):
        find_player(str(file), Role.PURSUER, SMALL)
    with pytest.raises(InvalidInput, match="solved for another game"):
        find_player(str(file), Role.EVADER, replace(SMALL, dt=0.2))
    with pytest.raises(InvalidInput, match="there is no agent file"):
        find_player(str(tmp_path / "none.safetensors"), Role.EVADER, SMALL)
    save_solution(REACH, file)
    with pytest.raises(InvalidInput, match="this is one of reach"):
        find_player(str(file), Role.PURSUER, SMALL)


@pytest.mark.parametrize("role", Role)
def test_nothing_is_interpolated_where_a_hold_moves_robots_by_whole_cells(role):
    """Every value is that of a game that ends after a number of steps, and the last sweep changed none."""
    problem = replace(joint_problem(CRAMPED, role, (4, 3, 3, 8)), hold=10, whole_cells=True)
    solution = solve_problem(problem, CRAMPED)
    assert solution.residual == 0
    values = np.abs(np.asarray(solution.table, np.float64))
    steps = -HORIZON / CRAMPED.dt * np.log(values[values > 0])
    assert len(np.unique(np.round(steps))) > 5
    np.testing.assert_allclose(steps, np.round(steps), atol=0.2)
    with pytest.raises(InvalidInput, match=r"whole_cells = True.*left out for all but game"):
        replace(problem, kind="safety")


@pytest.fixture
def solved(monkeypatch):
    """The problems that are solved, each at once by a table of its own."""
    problems = []

    def solve(problem, game, report):
        problems.append(problem)
        return Solution(problem, 1, 0.0, jnp.full((2, 120, 60), len(problems), jnp.float16))

    monkeypatch.setattr("apollonius.solve.solving.solve_problem", solve)
    return problems


def test_what_lies_in_the_folder_is_not_solved_again(solved, tmp_path):
    """Time limit and rewards are nothing to a table, the capture distance is; a damaged file is solved again."""
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
