"""The solved game of both sides, kept in a folder: solved once, by anyone who asks for the same."""

import numpy as np
import pytest

from apollonius.errors import InvalidInput
from apollonius.game.types import ROLES, Role
from apollonius.solve.kept import joint_problem, kept_tables
from apollonius.solve.solved import table_player, zero_sum_game_of
from apollonius.solve.solving import solve_problem
from tests.solve.small import CRAMPED, FEW


def test_what_lies_in_the_folder_is_not_solved_again(tmp_path):
    swept = []
    first = kept_tables(CRAMPED, FEW, tmp_path, lambda role, sweep: swept.append(role))
    assert set(swept) == set(Role)
    files = sorted(tmp_path.iterdir())
    assert [path.name.split("-")[0] for path in files] == ["evader", "pursuer"]
    swept.clear()
    again = kept_tables(CRAMPED, FEW, tmp_path, lambda role, sweep: swept.append(role))
    assert swept == []
    for role in Role:
        problem = joint_problem(CRAMPED, role, FEW)
        assert first[role].zero_sum_game == again[role].zero_sum_game == zero_sum_game_of(problem, CRAMPED)
        np.testing.assert_array_equal(first[role].table, again[role].table)
    other = kept_tables(CRAMPED, (4, 3, 2, 6), tmp_path, lambda role, sweep: swept.append(role))
    assert swept
    assert other.pursuer.table.size != first.pursuer.table.size


def test_without_a_folder_nothing_is_kept_and_the_same_is_found(tmp_path):
    tables = kept_tables(CRAMPED, FEW, None)
    for role, table in zip(ROLES, tables, strict=True):
        solved = solve_problem(joint_problem(CRAMPED, role, FEW), CRAMPED)
        np.testing.assert_array_equal(table.table, solved.table)


def test_a_damaged_file_is_refused(tmp_path):
    kept_tables(CRAMPED, FEW, tmp_path)
    for path in tmp_path.iterdir():
        path.write_bytes(path.read_bytes()[:1000])
        with pytest.raises(InvalidInput, match="solve it again"):
            table_player(path, CRAMPED)
    with pytest.raises(InvalidInput, match="solve it again"):
        kept_tables(CRAMPED, FEW, tmp_path)
