"""A program over flat arrays: what a JAX function is translated to before a language is chosen.

Functions read buffers, write buffers and compute with scalars. There are no shapes any more: an index is arithmetic.
Every part is immutable and compared by its contents, so that equal functions can be told to be one.
"""

import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from apollonius.export.record import Record

INDEX = "int32"
"""The kind of counters and indices."""


@dataclass(frozen=True)
class Number:
    """A literal. Kinds are the names of NumPy's types."""

    value: float | int | bool
    kind: str = INDEX


@dataclass(frozen=True)
class Name:
    """A scalar that has a name: a parameter, a loop's counter, or the constant of a `Let`."""

    name: str
    kind: str = INDEX


@dataclass(frozen=True)
class Buffer:
    """An array of one kind.

    Attributes:
        cell: whether it is a single variable, whose index is always 0.
        given: whether it is a parameter of its function.
        leaf: for an array of the whole program's arguments or results, the name of its record and its own.
    """

    name: str
    kind: str
    size: int
    cell: bool = False
    given: bool = False
    leaf: tuple[str, str] | None = None


@dataclass(frozen=True)
class Load:
    """An element of a buffer."""

    buffer: Buffer
    index: "Expression"

    @property
    def kind(self) -> str:
        """The kind of the element."""
        return self.buffer.kind


@dataclass(frozen=True)
class Apply:
    """An operation on scalars, all of one kind unless the operation is a conversion, a comparison or a choice."""

    operation: str
    kind: str
    operands: tuple["Expression", ...]


Expression = Number | Name | Load | Apply


@dataclass(frozen=True)
class Let:
    """A scalar constant."""

    name: Name
    value: Expression


@dataclass(frozen=True)
class Allocate:
    """A buffer of a function's own; its contents are undefined."""

    buffer: Buffer


@dataclass(frozen=True)
class Store:
    """An element of a buffer is set."""

    buffer: Buffer
    index: Expression
    value: Expression


@dataclass(frozen=True)
class Loop:
    """Statements repeated for a counter from 0 to `count - 1`."""

    counter: Name
    count: int
    body: tuple["Statement", ...]


@dataclass(frozen=True)
class While:
    """Statements repeated as long as `condition` holds after those of `before`."""

    before: tuple["Statement", ...]
    condition: Expression
    body: tuple["Statement", ...]


@dataclass(frozen=True)
class Branch:
    """One of two blocks of statements."""

    condition: Expression
    true: tuple["Statement", ...]
    false: tuple["Statement", ...]


@dataclass(frozen=True)
class Slice:
    """A buffer from some element on, as a function is given it."""

    buffer: Buffer
    offset: Expression


@dataclass(frozen=True)
class Call:
    """A call of another function, which writes its results to buffers."""

    function: str
    arguments: tuple[Expression | Slice, ...]


Statement = Let | Allocate | Store | Loop | While | Branch | Call


@dataclass(frozen=True)
class Function:
    """Statements with parameters: scalars and buffers, the last ones of which are its results."""

    name: str
    parameters: tuple[Name | Buffer, ...]
    results: tuple[Buffer, ...]
    body: tuple[Statement, ...]


@dataclass(frozen=True)
class Program:
    """A translated function: the last of its functions, which reads the arguments and writes the result.

    Attributes:
        name: an identifier that all its public names begin with.
        functions: each after those that it calls.
        constants: the arrays that the function closes over.
        arguments, results: how they lie in memory.
    """

    name: str
    functions: tuple[Function, ...]
    constants: tuple[tuple[Buffer, np.ndarray], ...]
    arguments: tuple[Record, ...]
    results: tuple[Record, ...]

    @property
    def records(self) -> tuple[Record, ...]:
        """The arguments and the results that have any array in them."""
        return tuple(record for record in (*self.arguments, *self.results) if record.leaves)


Reader = Callable[[tuple[Expression, ...]], Expression]
"""From an index, one expression for each axis, to the element there."""


_KNOWN: dict[str, Callable[..., Any]] = {
    **{name: getattr(operator, name) for name in ("add", "sub", "mul", "eq", "ne", "lt", "le", "gt", "ge", "neg")},
    "and": operator.and_,
    "or": operator.or_,
    "max": max,
    "min": min,
    "sign": lambda x: (x > 0) - (x < 0),
    "not": lambda x: not x,
}
"""Operations on whole numbers and truths that are computed here where their operands are literals."""


def apply(operation: str, kind: str, *operands: Expression) -> Expression:
    """Return an operation on scalars, computed here as far as its operands are known."""
    if operation == "select" and isinstance(operands[0], Number):
        return operands[1] if operands[0].value else operands[2]
    literals = [one for one in operands if isinstance(one, Number) and one.kind in ("int32", "bool")]
    known = operation in _KNOWN and len(literals) == len(operands) and (operation != "not" or kind == "bool")
    if known and abs(value := int(_KNOWN[operation](*(one.value for one in literals)))) < 2**31:
        return Number(bool(value) if kind == "bool" else value, kind)
    return Apply(operation, kind, operands)


def plus(one: Expression, other: Expression) -> Expression:
    """Return the sum of two indices, computed here as far as they are known."""
    if isinstance(one, Number) and isinstance(other, Number):
        return Number(int(one.value) + int(other.value))
    if isinstance(one, Number):
        one, other = other, one
    return one if other == Number(0) else Apply("add", INDEX, (one, other))


def times(one: Expression, factor: int) -> Expression:
    """Return a multiple of an index, computed here as far as it is known."""
    if isinstance(one, Number):
        return Number(int(one.value) * factor)
    if factor == 0:
        return Number(0)
    return one if factor == 1 else Apply("mul", INDEX, (one, Number(factor)))
