"""Compiled functions of objects that pickle: for processes that are spawned, and for other machines."""

import functools
from collections.abc import Callable
from typing import Any

import jax


class Compiled:
    """A function, compiled at its first call with its first arguments as constants.

    It is pickled as what it is made of; what is read compiles for itself.

    Args:
        function: of a module, so that pickle finds it by name.
        constants: its first arguments.
    """

    def __init__(self, function: Callable[..., Any], *constants: Any) -> None:
        self._function, self._constants = function, constants
        self._compiled = jax.jit(functools.partial(function, *constants))

    def __call__(self, *arguments: Any) -> Any:
        """What the function returns for the rest of its arguments."""
        return self._compiled(*arguments)

    def __reduce__(self) -> tuple[type["Compiled"], tuple[Any, ...]]:
        return Compiled, (self._function, *self._constants)

    def __deepcopy__(self, memo: dict[int, Any]) -> "Compiled":
        return self  # nothing of it ever changes
