"""Solutions as files: the table, compressed, and a header that says what was solved and how well."""

import io
import json
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Shaped

from apollonius.agents.store import write_atomically
from apollonius.errors import InvalidInput

FORMAT = "apollonius-solution"
FORMAT_VERSION = 1


@dataclass(frozen=True)
class Problem:
    """What is solved: two solutions of one problem are the same."""

    kind: str
    """`safety`, `reach` or `game`."""
    role: str
    """The side whose robot it is, or that moves first: `pursuer` or `evader`."""
    game: dict[str, Any]
    """The game, number by number."""
    counts: list[int]
    """Nodes along x, y, v and heading."""
    hold: int
    """Control steps for which an action is held."""
    target: list[float] | None = None
    """Where the target stands [m]; of `reach` only."""
    payoff: str | None = None
    """What outcomes are worth (`contest.PAYOFFS`); of `game` only."""


@dataclass(frozen=True)
class Solution:
    """A solved problem."""

    problem: Problem
    sweeps: int
    residual: float
    """Largest change of a value in the last sweep."""
    table: Shaped[Array, "..."]
    """Values at the nodes, by (v, heading, x, y); of `game` what `solve_duel` returns, in half precision."""


def save_solution(solution: Solution, path: Path) -> None:
    """Write a solution's file, atomically.

    Raises:
        OSError: when the file cannot be written.
    """
    header = {"format": FORMAT, "version": FORMAT_VERSION, "problem": asdict(solution.problem)}
    header |= {"sweeps": solution.sweeps, "residual": solution.residual}
    content = io.BytesIO()
    np.savez_compressed(content, header=np.array(json.dumps(header)), table=np.asarray(solution.table))
    write_atomically(path, content.getvalue())


def load_solution(path: Path) -> Solution:
    """Read a solution's file.

    Raises:
        InvalidInput: for a file that is missing, damaged, not a solution's, or of another version.
    """
    if not path.is_file():
        raise InvalidInput(f"there is no solution '{path}': check the path, or solve it with apollonius solve.")
    foreign = f"'{path}' holds no whole Apollonius solution: solve it again, with another --out."
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            header, table = json.loads(str(file["header"])), np.asarray(file["table"])
        if header["format"] != FORMAT:
            raise InvalidInput(foreign)
        if header["version"] != FORMAT_VERSION:
            raise InvalidInput(
                f"'{path}' has format version {header['version']}, this program reads {FORMAT_VERSION}: update it."
            )
        problem = Problem(**header["problem"])
        if not _fits(problem, table):
            raise InvalidInput(foreign)
        return Solution(problem, header["sweeps"], header["residual"], jnp.asarray(table))
    except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        if isinstance(error, InvalidInput):
            raise
        raise InvalidInput(foreign) from error


def _fits(problem: Problem, table: np.ndarray) -> bool:
    """Whether the table is of the kind and shape that the problem asks for."""
    x, y, v, heading = problem.counts
    if problem.kind == "game":
        return table.dtype == np.float16 and table.ndim == 3 and table.size == (x * y * v * heading) ** 2
    return table.dtype == np.float32 and table.shape == (v, heading, x, y)
