"""Comparison of a program in C with its JAX function."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from jax.extend.core import jaxpr_as_fun

from jaxpr2c.compiler import CompiledProgram
from jaxpr2c.errors import Mismatch
from jaxpr2c.program import Program

TOLERANCE = 1e-4
"""Greatest difference of a number from JAX's, as a share of the largest one of its array."""
_ROUNDING = 1e-5
"""Distance from an argument, as a share of it, within which JAX's results count as the same."""
_AROUND = 64
"""Arguments within rounding that JAX is asked for where results differ."""
_NEAR = (0.1, 0.01)
"""Distance from its arguments at which a program is tried: a share of a number, and its least size.
"""
_NEARBY = 3
"""Arguments near the first ones with which a program is tried."""


def check_program(program: Program, function: Callable[..., Any], *arguments: Any) -> None:
    """Compile a program by gcc, and require that it has the results of its JAX function, for the
    arguments and some near them.

    A result must be between the results of JAX near the arguments, to `TOLERANCE` of the largest
    number.

    Args:
        program: The program.
        function: The function that it was translated from.
        arguments: Its arguments, or their shapes, which stand for ones.

    Raises:
        Mismatch: If the results differ.
        CompilerFailure: If gcc is missing or fails.
    """
    closed_jaxpr = jax.make_jaxpr(function)(*arguments)
    in_c = CompiledProgram(program)
    in_jax = jax.jit(jaxpr_as_fun(closed_jaxpr))
    rng = np.random.default_rng(0)
    leaves, shape = jax.tree.flatten(arguments)

    def example(leaf: Any, aval: Any) -> np.ndarray:
        if isinstance(leaf, jax.ShapeDtypeStruct):
            return np.ones(aval.shape, aval.dtype)
        return np.asarray(leaf, aval.dtype)

    first = [*map(example, leaves, closed_jaxpr.in_avals)]

    def near(numbers: list[np.ndarray], breadth: float, least: float) -> list[np.ndarray]:
        """Return the numbers with random offsets of real ones, in shares of their size, at least of
        `least`.
        """
        sizes = [
            breadth * np.maximum(abs(array), least) * (array.dtype == np.float32)
            for array in numbers
        ]

        def offset(array: np.ndarray, size: Any) -> np.ndarray:
            sample = array + size * rng.uniform(-1, 1, array.shape)
            return np.where(np.isfinite(array), sample, array).astype(array.dtype)

        return [*map(offset, numbers, sizes)]

    for numbers in (first, *(near(first, *_NEAR) for _ in range(_NEARBY))):
        results = in_c(*jax.tree.unflatten(shape, numbers))
        answers = [in_jax(*numbers)]
        if not _is_among(results, answers):
            answers += [in_jax(*near(numbers, _ROUNDING, 1.0)) for _ in range(_AROUND)]
        if not _is_among(results, answers):
            title = f"the program {program.name} in C"
            raise Mismatch(f"{title} differs from JAX: report this as an error.")


def _is_among(results: Sequence[np.ndarray], answers: Sequence[Sequence[Any]]) -> bool:
    """Test whether all numbers are between those of the answers, or are NaN where an answer is."""
    for result, *several in zip(results, *answers, strict=True):
        rows = np.array(several, float)
        largest = abs(rows[np.isfinite(rows)]).max(initial=1e-3)
        slack = TOLERANCE * largest * (result.dtype == np.float32)
        low = np.fmin.reduce(rows) - slack
        high = np.fmax.reduce(rows) + slack
        is_between = (low <= result) & (result <= high)
        is_nan = np.isnan(rows).any(axis=0) & np.isnan(result)
        if not (is_between | is_nan).all():
            return False
    return True
