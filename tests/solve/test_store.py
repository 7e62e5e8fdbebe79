"""Solutions as files: they come back as they went, and what is no solution is refused."""

import json
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.record import to_dict
from apollonius.errors import InvalidInput
from apollonius.solve.store import Problem, Solution, load_solution, save_solution
from tests.solve.small import SMALL

PROBLEM = Problem("reach", "pursuer", to_dict(SMALL), [4, 3, 2, 5], 5, [0.5, 1.0])
SOLUTION = Solution(PROBLEM, 12, 3e-5, jnp.arange(120, dtype=jnp.float32).reshape(2, 5, 4, 3))


def rewrite(path, **changes):
    """The file with other entries."""
    with np.load(path) as file:
        entries = dict(file) | changes
    np.savez_compressed(path, **entries)


def test_a_solution_comes_back_as_it_went(tmp_path):
    save_solution(SOLUTION, tmp_path / "s.npz")
    found = load_solution(tmp_path / "s.npz")
    assert (found.problem, found.sweeps, found.residual) == (PROBLEM, SOLUTION.sweeps, SOLUTION.residual)
    np.testing.assert_array_equal(found.table, SOLUTION.table)
    assert found.table.dtype == jnp.float32


def test_it_is_compressed(tmp_path):
    flat = replace(SOLUTION, problem=replace(PROBLEM, counts=[50, 50, 2, 5]), table=jnp.zeros((2, 5, 50, 50)))
    save_solution(flat, tmp_path / "s.npz")
    assert (tmp_path / "s.npz").stat().st_size < flat.table.nbytes / 10


@pytest.mark.parametrize("damage", ["missing", "cut", "text", "no header", "shape", "kind", "order", "foreign"])
def test_what_is_no_solution_is_refused(tmp_path, damage):
    path = tmp_path / "s.npz"
    save_solution(SOLUTION, path)
    if damage == "missing":
        path.unlink()
    elif damage == "cut":
        path.write_bytes(path.read_bytes()[:300])
    elif damage == "text":
        path.write_text("not a table")
    elif damage == "no header":
        rewrite(path, header=np.array("{}"))
    elif damage == "shape":
        rewrite(path, table=np.zeros((2, 5, 3, 4), np.float32))
    elif damage == "kind":
        rewrite(path, table=np.zeros((2, 5, 4, 3), np.float64))
    elif damage == "order":
        rewrite(path, table=np.zeros((2, 5, 4, 3), np.float32, order="F"))
    else:
        rewrite(path, header=np.array(json.dumps({"format": "another"})))
    with pytest.raises(InvalidInput, match=r"no solution|no whole Apollonius solution"):
        load_solution(path)


def test_a_newer_file_is_refused(tmp_path):
    save_solution(SOLUTION, tmp_path / "s.npz")
    with np.load(tmp_path / "s.npz") as file:
        header = json.loads(str(file["header"])) | {"version": 99}
    rewrite(tmp_path / "s.npz", header=np.array(json.dumps(header)))
    with pytest.raises(InvalidInput, match="version 99"):
        load_solution(tmp_path / "s.npz")
