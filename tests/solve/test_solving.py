"""Players from the files of solved games."""

import shutil
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.shield import Shielded
from apollonius.agents.store import AgentHeader
from apollonius.arenas.record import to_dict
from apollonius.catalogue import find_player
from apollonius.game.game import reset_batch
from apollonius.game.types import ROLES, Role
from apollonius.io.errors import InvalidInput
from apollonius.solve.joint import make_duel, solve_duel
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.solving import joint_problem, kept_tables, solve_problem, zero_sum_game_of
from apollonius.solve.store import Problem, Solution, load_solution, save_solution
from tests.solve.small import CRAMPED, FEW, SMALL

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


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A folder and the tables in it. More may be kept there."""
    folder, swept = tmp_path_factory.mktemp("kept"), []
    tables = kept_tables(CRAMPED, FEW, folder, lambda role, sweep: swept.append(role))
    assert set(swept) == set(Role)
    return folder, tables


def test_what_lies_in_the_folder_is_not_solved_again(kept):
    swept = []
    folder, first = kept
    assert sorted(path.name.split("-")[0] for path in folder.iterdir()) == ["evader", "pursuer"]
    again = kept_tables(CRAMPED, FEW, folder, lambda role, sweep: swept.append(role))
    assert swept == []
    for role in Role:
        problem = joint_problem(CRAMPED, role, FEW)
        assert first[role].zero_sum_game == again[role].zero_sum_game == zero_sum_game_of(problem, CRAMPED)
        np.testing.assert_array_equal(first[role].table, again[role].table)
    longer = replace(CRAMPED, max_steps=7, reward=replace(CRAMPED.reward, progress=1.0))
    assert kept_tables(longer, FEW, folder, lambda role, sweep: swept.append(role)).pursuer.zero_sum_game.game == longer
    assert swept == [], "time limit and rewards are nothing to a table"
    nearer = replace(CRAMPED, capture_distance=0.8 * CRAMPED.capture_distance)
    other = kept_tables(nearer, FEW, folder, lambda role, sweep: swept.append(role))
    assert swept
    assert np.any(other.pursuer.table != first.pursuer.table)


@pytest.mark.slow
def test_without_a_folder_nothing_is_kept_and_the_same_is_found(kept):
    tables = kept_tables(CRAMPED, FEW, None)
    for role, table in zip(ROLES, tables, strict=True):
        solved = solve_problem(joint_problem(CRAMPED, role, FEW), CRAMPED)
        np.testing.assert_array_equal(table.table, solved.table)


def test_a_damaged_file_is_solved_again(kept, tmp_path):
    folder = shutil.copytree(kept[0], tmp_path / "damaged")
    sound = {path: path.read_bytes() for path in folder.iterdir()}
    for path, content in sound.items():
        path.write_bytes(content[:-1])
    kept_tables(CRAMPED, FEW, folder)
    mended = [path for path, content in sound.items() if path.read_bytes() == content]
    assert sorted(path.name.split("-")[0] for path in mended) == ["evader", "pursuer"]
