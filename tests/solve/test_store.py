"""Solutions as files: they come back as they went, and what is no solution is refused."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import load, save

from apollonius.arenas.record import to_dict
from apollonius.io.errors import InvalidInput
from apollonius.solve.store import Problem, Solution, is_solution, load_solution, save_solution
from tests.solve.small import SMALL

PROBLEM = Problem("reach", "pursuer", to_dict(SMALL), [4, 3, 2, 5], 5, [0.5, 1.0])
SOLUTION = Solution(PROBLEM, 12, 3e-5, jnp.arange(120, dtype=jnp.float32).reshape(2, 5, 4, 3))


def rewrite(path, header=None, **arrays):
    """The file with another header, or other arrays."""
    content = path.read_bytes()
    size = int.from_bytes(content[:8], "little")
    told = json.loads(content[8 : 8 + size])["__metadata__"]["header"]
    path.write_bytes(save(load(content) | arrays, {"header": json.dumps(json.loads(told) | (header or {}))}))


def test_a_solution_comes_back_as_it_went(tmp_path):
    save_solution(SOLUTION, tmp_path / "s.safetensors")
    found = load_solution(tmp_path / "s.safetensors")
    assert (found.problem, found.sweeps, found.residual) == (PROBLEM, SOLUTION.sweeps, SOLUTION.residual)
    np.testing.assert_array_equal(found.table, SOLUTION.table)
    assert found.table.dtype == jnp.float32


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        ({"table": np.zeros((2, 5, 3, 4), np.float32)}, "size"),
        ({"table": np.zeros((2, 5, 4, 3), np.float16)}, "size"),
        ({"other": np.zeros(3, np.float32)}, "size"),
        ({"header": {"format": "another"}}, "no whole Apollonius solution"),
        ({"header": {"version": 99}}, "version 99"),
    ],
)
def test_what_is_no_solution_is_refused(tmp_path, damage, said):
    path = tmp_path / "s.safetensors"
    save_solution(SOLUTION, path)
    assert is_solution(path)
    rewrite(path, **damage)
    with pytest.raises(InvalidInput, match=said):
        load_solution(path)
    assert is_solution(path) == ("header" not in damage)


@pytest.mark.parametrize("content", [None, b"", b"not a table"])
def test_what_is_no_file_of_arrays_is_refused(tmp_path, content):
    path = tmp_path / "s.safetensors"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InvalidInput, match=r"no solution|not a whole Apollonius solution"):
        load_solution(path)
    assert not is_solution(path)
    assert not is_solution(tmp_path)
