"""The solved game of both sides, kept in a folder: solved once, by anyone who asks for the same."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from apollonius.game.types import ROLES, Role
from apollonius.solve.solved import zero_sum_game_of
from apollonius.solve.solving import joint_problem, kept_tables, solve_problem
from tests.solve.small import CRAMPED, FEW


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
