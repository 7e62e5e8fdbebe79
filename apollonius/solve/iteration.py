"""Value iteration: sweeps until nothing moves, with what a person wants to know meanwhile."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from math import log

from jaxtyping import Array, Float

from apollonius.errors import InvalidInput
from apollonius.game.types import Scalar
from apollonius.solve.grid import Grid

Table = Float[Array, "v heading x y"]
TOLERANCE = 1e-4
"""A sweep that changes no value by more than this is the last one."""
_MOST_SWEEPS = 10_000


@dataclass(frozen=True)
class Sweep:
    """What the latest sweep did."""

    number: int
    residual: float
    """Largest change of a value."""
    seconds: float
    """Since the first sweep began."""

    def seconds_left(self, first_residual: float) -> float:
        """Seconds to go if the residual goes on falling as it did on average so far; a rough guess."""
        fallen = log(first_residual / max(self.residual, TOLERANCE))
        to_fall = log(max(self.residual, TOLERANCE) / TOLERANCE)
        return self.seconds * to_fall / fallen if fallen > 0 else float("inf")


def silent(sweep: Sweep) -> None:
    """Tells nobody."""


@dataclass(frozen=True)
class Solved:
    """A table that a sweep leaves as it is, but for the residual."""

    table: Table
    sweeps: int
    residual: float


def iterate(
    sweep: Callable[[Table], tuple[Table, Scalar]], table: Table, report: Callable[[Sweep], None] = silent
) -> Solved:
    """Sweep until the residual is at most `TOLERANCE`.

    Args:
        sweep: from a table, the next one and the largest change.
        table: where to begin.
        report: told after each sweep.
    """
    begun, residual = time.perf_counter(), float("inf")
    for number in range(1, _MOST_SWEEPS + 1):
        table, change = sweep(table)
        residual = float(change)
        report(Sweep(number, residual, time.perf_counter() - begun))
        if residual <= TOLERANCE:
            return Solved(table, number, residual)
    raise RuntimeError(f"value iteration still moves by {residual:g} after {_MOST_SWEEPS} sweeps")


def require_memory(grid: Grid, bytes_per_node: int) -> None:
    """Refuse a grid that this machine has no room for.

    Raises:
        InvalidInput: with the memory needed and the memory there is.
    """
    needed = grid.size * bytes_per_node / 2**30
    available = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    if needed > available:
        written = "x".join(map(str, grid.counts))
        raise InvalidInput(
            f"grid = {written} needs {needed:,.1f} GiB of memory and this machine has {available:,.1f} GiB: "
            "take fewer nodes."
        )
