"""Players from the files of solved games."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.shield import Shielded
from apollonius.agents.store import AgentHeader
from apollonius.arenas.record import to_dict
from apollonius.catalogue import find_player
from apollonius.errors import InvalidInput
from apollonius.game.game import reset_batch
from apollonius.game.types import Role
from apollonius.solve.guarantee import make_duel, solve_duel
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.solved import zero_sum_game_of
from apollonius.solve.store import Problem, Solution, load_solution, save_solution
from tests.solve.small import SMALL

PROBLEM = Problem("game", "evader", to_dict(SMALL), [3, 4, 2, 4], 5, payoff="time")


@pytest.fixture(scope="module")
def solution():
    solved = solve_duel(make_duel(zero_sum_game_of(PROBLEM, SMALL)), tolerance=0.1)
    return Solution(PROBLEM, solved.sweeps, solved.residual, solved.table.astype("float16"))


@pytest.fixture
def file(tmp_path, solution):
    save_solution(solution, tmp_path / "solved.safetensors")
    return tmp_path / "solved.safetensors"


def test_a_solved_game_comes_back_as_it_went_and_plays(file, solution):
    np.testing.assert_array_equal(load_solution(file).table, solution.table)
    player = find_player(str(file), Role.EVADER, SMALL)
    assert player.name == "solved"
    expected = SaddlePolicy(zero_sum_game_of(PROBLEM, SMALL), solution.table)
    starts = jax.jit(reset_batch, static_argnames="games")(SMALL, jax.random.key(0), games=20)
    np.testing.assert_array_equal(player.policy.best_value(starts), expected.best_value(starts))
    assert np.all(np.asarray(expected.best_value(starts)) <= 0)


def test_where_games_begin_and_end_is_nothing_to_a_solution(file):
    other = replace(SMALL, max_steps=77, starts=replace(SMALL.starts, speed="moving"))
    assert find_player(str(file), Role.EVADER, other).policy.zero_sum_game.game.max_steps == 77


def test_it_can_be_shielded(file):
    found = find_player(f"shielded:{file}", Role.EVADER, SMALL)
    assert found.name == "shielded:solved"
    assert isinstance(found.policy, Shielded)


def test_other_players_are_found_as_ever():
    found = find_player("P_stage1", Role.PURSUER, SMALL)
    assert isinstance(found.header, AgentHeader)


def test_a_file_of_something_else_is_refused(file, solution, tmp_path):
    with pytest.raises(
        InvalidInput, match=r"pursuer = '.*solved.safetensors'.*solved for the pursuer; this is the evader's"
    ):
        find_player(str(file), Role.PURSUER, SMALL)
    with pytest.raises(InvalidInput, match="solved for another game"):
        find_player(str(file), Role.EVADER, replace(SMALL, dt=0.2))
    with pytest.raises(InvalidInput, match="there is no agent file"):
        find_player(str(tmp_path / "none.safetensors"), Role.EVADER, SMALL)
    flat = replace(solution, table=solution.table[:1])
    save_solution(flat, file)
    with pytest.raises(InvalidInput, match="no whole Apollonius solution"):
        find_player(str(file), Role.EVADER, SMALL)
    reach = replace(PROBLEM, kind="reach", role="pursuer", payoff=None, target=[0.5, 1.0])
    save_solution(Solution(reach, 1, 0.0, jnp.zeros((2, 4, 3, 4))), file)
    with pytest.raises(InvalidInput, match="this is one of reach"):
        find_player(str(file), Role.PURSUER, SMALL)
