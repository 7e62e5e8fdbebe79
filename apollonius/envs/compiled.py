"""Compiled functions of objects that pickle: for processes that are spawned, and for other machines."""

import functools
import os
from collections.abc import Callable
from typing import Any

import jax

from apollonius.io.errors import InvalidInput


class Compiled:
    """A function of a module, compiled at its first call with its first arguments as constants.

    It is pickled as what it is made of; what is read compiles for itself.
    """

    def __init__(self, function: Callable[..., Any], *constants: Any) -> None:
        self._function, self._constants = function, constants
        self._compiled = jax.jit(functools.partial(function, *constants))

    def __call__(self, *arguments: Any) -> Any:
        """Return the result of the function for the rest of its arguments."""
        return self._compiled(*arguments)

    def __reduce__(self) -> tuple[type["Compiled"], tuple[Any, ...]]:
        return Compiled, (self._function, *self._constants)

    def __deepcopy__(self, memo: dict[int, Any]) -> "Compiled":
        return self  # nothing of it ever changes


_forked: list[bool] = []
os.register_at_fork(after_in_child=lambda: _forked.append(True))


def require_unforked() -> None:
    """Refuse, by InvalidInput, to compute in a process that was forked after this module was imported."""
    if _forked:
        raise InvalidInput(
            "JAX cannot compute in a forked process: start it by spawning, as "
            "gymnasium.vector.AsyncVectorEnv does with context='spawn', or take gymnasium.make_vec."
        )
