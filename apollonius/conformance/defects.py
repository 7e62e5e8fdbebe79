"""Properties that a part lacks, gathered so that all are shown at once."""

from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np
from jax.errors import JAXIndexError, JAXTypeError
from jax.extend.core import ClosedJaxpr

from apollonius.io.errors import InvalidInput, format_value, require
from jaxpr2c.errors import TranslationError

_TRACED = (
    "JAX compiles it and so knows no values of arrays: use jnp for np, jnp.where or "
    "jax.lax.cond for if"
)


class Nonconformance(ValueError):
    """The refusal of a part that lacks properties: `defects` has a line for each, which says what
    to mend.
    """

    def __init__(self, part: str, defects: list[str]) -> None:
        self.defects = tuple(defects)
        super().__init__("\n  ".join([f"{part} has to be mended:", *defects]))


def require_all(part: str, properties: Mapping[str, Callable[[], object]]) -> None:
    """Try all properties, each a function that raises an error where it does not hold; raises
    Nonconformance.
    """
    defects: list[str] = []
    for name, demand in properties.items():
        try:
            demand()
        except (InvalidInput, TranslationError) as error:
            defects.append(f"{name}: {error}")
        except (JAXTypeError, JAXIndexError) as error:
            defects.append(f"{name}: {_TRACED} ({type(error).__name__}).")
        except Exception as error:  # whatever somebody else's code raises
            defects.append(
                f"{name}: mend this error: {type(error).__name__}: {format_value(error)}"
            )
    if defects:
        raise Nonconformance(part, defects)


def require_pure(function: Callable[..., Any], *arguments: Any) -> None:
    """Refuse a function that prints, calls Python or changes from one trace to the next; raises
    InvalidInput.
    """
    first, second = (jax.make_jaxpr(_fresh_copy(function))(*arguments) for _ in range(2))
    require(not first.effects, "effects", first.effects, "none: take out callbacks and prints")
    bound = (
        "the same for the same arguments: take randomness from `bits` or a key, keep nothing "
        "in Python's variables"
    )
    require(_is_same(first, second), "its computation", "another in each trace", bound)


def _fresh_copy(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function as a new one, which JAX traces again."""
    return lambda *arguments: function(*arguments)


def _is_same(first: ClosedJaxpr, second: ClosedJaxpr) -> bool:
    constants = (
        zip(first.consts, second.consts, strict=True)
        if len(first.consts) == len(second.consts)
        else ()
    )
    same = all(np.array_equal(first, second, equal_nan=True) for first, second in constants)
    return same and str(first) == str(second) and len(first.consts) == len(second.consts)


def require_rows(
    function: Callable[..., Any], rows: Any, tolerance: float, most: float = 0.02
) -> Any:
    """Return a function's results for rows of arguments, refused unless they are the same again and
    row by row.

    Rounding can decide some rows: a share of `most` may differ by more than the `tolerance`. Raises
    InvalidInput.
    """
    batch = jax.jit(jax.vmap(function))
    results, again = batch(*rows), batch(*rows)
    same = jax.tree.map(
        lambda first, second: np.array_equal(first, second, equal_nan=True), results, again
    )
    require(jax.tree.all(same), "results", "others for the same arguments", "the same to the bit")
    alone = jax.jit(lambda rows: jax.lax.map(lambda row: function(*row), rows))(rows)
    for row, alone_row in zip(jax.tree.leaves(results), jax.tree.leaves(alone), strict=True):
        away = np.abs(np.asarray(row, float) - np.asarray(alone_row, float)).reshape(len(row), -1)
        share = float((away > tolerance).any(axis=1).mean())
        bound = "the same for each row as alone: let no row depend on others"
        require(share <= most, "results of a batch", f"others in {share:.0%} of its rows", bound)
    return results
