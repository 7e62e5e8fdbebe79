"""How impossible input is refused: one line that names the value, the bound and the remedy."""

import sys
from collections.abc import Callable
from typing import Any


class InvalidInput(ValueError):
    """Something a person gave cannot be used. Its message is one line, fit to be shown as it is."""

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.splitlines()))  # what was given may have lines of its own


def require(holds: Any, name: str, value: object, bound: str) -> None:
    """Refuse a value unless the condition holds.

    Args:
        holds: whether the value can be used.
        name: what the value is called where it was given.
        value: what was given.
        bound: what it must be, and how to get there; completes "it must be ...".

    Raises:
        InvalidInput: if it cannot.
    """
    if not holds:
        raise InvalidInput(f"{name} = {value} is not possible: it must be {bound}.")


def require_positive(record: object, *names: str) -> None:
    """Refuse a record unless its fields of these names are more than 0.

    Raises:
        InvalidInput: for the first that is not.
    """
    for name in names:
        value = getattr(record, name)
        require(value > 0, name, value, "more than 0")


def exit_status(program: Callable[[], int]) -> int:
    """What a program ends with; after impossible input, a line on standard error and 2."""
    try:
        return program()
    except InvalidInput as error:
        print(error, file=sys.stderr)
        return 2
