"""Solutions as files: the table in safetensors, and a header that says what was solved and how
well.
"""

from dataclasses import dataclass
from math import inf, prod
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Shaped

from apollonius.arenas.file import from_dict
from apollonius.game.validation import MAX_SIZE
from apollonius.io.arrays import kinds_in, open_arrays, read_header, require_finite, write_arrays
from apollonius.io.errors import InvalidInput, require
from apollonius.io.limits import HOLD, JOINT_HOLD, MOST_COUNTED, require_memory
from apollonius.solve.grid import FEWER_NODES

FORMAT = "apollonius-solution", 1
KINDS = ("safety", "reach", "game")
"""Problems that can be solved."""
_MOST_NODES = 1_000_000


@dataclass(frozen=True)
class Problem:
    """A problem to solve: two solutions of one problem are the same."""

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
    """Place of the target [m]; of `reach` only."""
    whole_cells: bool = False
    """Round moves along x and y to whole cells; of `game` only."""

    def __post_init__(self) -> None:
        require(self.kind in KINDS, "kind", self.kind, f"one of {', '.join(KINDS)}")
        require(self.role in ("pursuer", "evader"), "role", self.role, "pursuer or evader")
        four = len(self.counts) == 4 and min(self.counts) >= 2 and max(self.counts) <= _MOST_NODES
        require(four, "counts", self.counts, f"four numbers of nodes, from 2 to {_MOST_NODES:,}")
        (JOINT_HOLD if self.kind == "game" else HOLD).require("hold", self.hold)
        target = self.target is not None
        require(
            target == (self.kind == "reach"),
            "target",
            self.target,
            "given for reach, and left out otherwise",
        )
        require(
            self.kind == "game" or not self.whole_cells,
            "whole_cells",
            self.whole_cells,
            "left out for all but game",
        )
        place = [abs(number) <= MAX_SIZE for number in self.target or ()]
        require(not target or place == [True, True], "target", self.target, "x and y")


@dataclass(frozen=True)
class _Header:
    """Header of a solution's file."""

    problem: Problem
    sweeps: int
    residual: float
    """Largest change of a value in the last sweep."""

    def __post_init__(self) -> None:
        require(0 <= self.sweeps <= MOST_COUNTED, "sweeps", self.sweeps, "0 or more")
        require(0 <= self.residual < inf, "residual", self.residual, "0 or more, and finite")


@dataclass(frozen=True)
class Solution(_Header):
    """A solved problem."""

    table: Shaped[Array, "..."]
    """Values at the nodes, by (v, heading, x, y); of `game` what `solve_duel` returns, in half
    precision.
    """


def save_solution(solution: Solution, path: Path) -> None:
    """Write a solution's file, atomically."""
    header = _Header(solution.problem, solution.sweeps, solution.residual)
    write_arrays(path, {"table": np.asarray(solution.table)}, header, FORMAT)


def load_solution(path: Path) -> Solution:
    """Read a solution's file, the table only if its size is what the header says; raises
    InvalidInput for a file that is missing, damaged, foreign, larger than memory, or with values
    that are not finite.
    """
    remedy = "solve it again, into another file"
    foreign = f"'{path}' holds no whole Apollonius solution: {remedy}"
    with open_arrays(path, remedy, "Apollonius solution") as file:
        fields = read_header(path, file, FORMAT, foreign)
        header = from_dict(_Header, fields, f"the header of '{path}'")
        if not _fits(header.problem, kinds_in(file), path):
            raise InvalidInput(f"{foreign} (its table is not of the size that its header says).")
        table = file.get_tensor("table")
    require_finite(path, {"table": table}, "solve it again")
    return Solution(header.problem, header.sweeps, header.residual, jnp.asarray(table))


def is_solution(path: Path) -> bool:
    try:
        with open_arrays(path, "") as file:
            return bool(read_header(path, file, FORMAT, ""))
    except (InvalidInput, OSError):
        return False


def _fits(problem: Problem, kinds: dict[str, tuple[tuple[int, ...], Any]], path: Path) -> bool:
    """Check whether arrays are the table that a problem asks for, by shapes and number types."""
    x, y, v, heading = problem.counts
    two = problem.kind == "game"
    expected = np.dtype(np.float16 if two else np.float32)
    size = (x * y * v * heading) ** (2 if two else 1)
    require_memory(
        f"'{path}': grid",
        "x".join(map(str, problem.counts)),
        2 * size * expected.itemsize,
        FEWER_NODES,
    )
    shape, kind = kinds.get("table", ((), None))
    fits = (len(shape) == 3 and prod(shape) == size) if two else shape == (v, heading, x, y)
    return set(kinds) == {"table"} and kind == expected and fits
