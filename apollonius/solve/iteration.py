"""Value iteration: sweeps until nothing moves, with what a person wants to know meanwhile."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from math import log

from jaxtyping import Array, Float

from apollonius.game.types import Scalar

Table = Float[Array, "..."]
"""Values at the nodes of a grid."""
TOLERANCE = 1e-4
"""A sweep that changes no value by more than this is the last one, where nothing else is asked."""
_MOST_SWEEPS = 10_000
_ROUNDING = 1e-7
"""Changes of this size are as good as none, where one tells how far a solution is."""


@dataclass(frozen=True)
class Sweep:
    """What the latest sweep did."""

    number: int
    residual: float
    """Largest change of a value."""
    seconds: float
    """Since the first sweep began."""
    tolerance: float = TOLERANCE
    """The residual that is asked for."""

    def share(self, first_residual: float) -> float:
        """Part of the way from the first residual to the last, as residuals fall by a factor each time."""
        wanted = max(self.tolerance, _ROUNDING)
        whole = log(max(first_residual, wanted) / wanted)
        return 1 - log(max(self.residual, wanted) / wanted) / whole if whole > 0 else 1.0


def silent(sweep: Sweep) -> None:
    """Tells nobody."""


@dataclass(frozen=True)
class Solved:
    """A table that a sweep leaves as it is, but for the residual."""

    table: Table
    sweeps: int
    residual: float


def iterate(
    sweep: Callable[[Table], tuple[Table, Scalar]],
    table: Table,
    report: Callable[[Sweep], None] = silent,
    tolerance: float = TOLERANCE,
) -> Solved:
    """Sweep until the residual is at most the tolerance.

    Args:
        sweep: from a table, the next one and the largest change.
        table: where to begin.
        report: told after each sweep.
        tolerance: the residual that is asked for. If it has not come after 10,000 sweeps, `TOLERANCE` has to do.
    """
    begun, residual = time.perf_counter(), float("inf")
    for number in range(1, _MOST_SWEEPS + 1):
        table, change = sweep(table)
        residual = float(change)
        report(Sweep(number, residual, time.perf_counter() - begun, tolerance))
        if residual <= (tolerance if number < _MOST_SWEEPS else max(tolerance, TOLERANCE)):
            return Solved(table, number, residual)
    raise RuntimeError(f"value iteration still moves by {residual:g} after {_MOST_SWEEPS} sweeps")
