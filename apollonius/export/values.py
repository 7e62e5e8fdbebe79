"""Values of a program in the making: each is read element by element, and stored only where that saves work."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

import numpy as np

from apollonius.export.program import (
    Allocate,
    Buffer,
    Expression,
    Let,
    Load,
    Loop,
    Name,
    Number,
    Reader,
    Statement,
    Store,
    plus,
    times,
)

Shape = tuple[int, ...]
Index = tuple[Expression, ...]


@dataclass(frozen=True)
class Place:
    """Where a value lies: a buffer, the index of its first element, and how far its neighbours along each axis are."""

    buffer: Buffer
    offset: Expression
    strides: tuple[int, ...]

    def at(self, index: Index) -> Expression:
        """Return the index in the buffer of an element."""
        here = self.offset
        for step, stride in zip(index, self.strides, strict=True):
            here = plus(here, times(step, stride))
        return here


@dataclass(frozen=True)
class Value:
    """An array that can be read.

    Attributes:
        kind: its number type.
        shape: its shape.
        read: returns the element at an index.
        place: where it lies; None if it is computed as it is read.
        free: whether reading it costs nothing, so that it need never be stored.
    """

    kind: str
    shape: Shape
    read: Reader
    place: Place | None = None
    free: bool = False

    @property
    def size(self) -> int:
        """Number of elements."""
        return prod(self.shape)

    @property
    def first(self) -> Expression:
        """Its first element, the only one of a lone number."""
        return self.read((Number(0),) * len(self.shape))

    @property
    def whole(self) -> bool:
        """Whether it lies somewhere in one piece, row by row."""
        return self.place is not None and (self.size == 1 or self.place.strides == contiguous(self.shape))


def contiguous(shape: Shape) -> tuple[int, ...]:
    """Return the strides of an array that lies row by row; 0 along axes of length 1."""
    strides = [prod(shape[axis + 1 :]) for axis in range(len(shape))]
    return tuple(0 if length == 1 else stride for stride, length in zip(strides, shape, strict=True))


def placed(shape: Shape, place: Place) -> Value:
    """Return the value that lies at a place."""
    strides = tuple(0 if length == 1 else stride for stride, length in zip(place.strides, shape, strict=True))
    place = Place(place.buffer, place.offset, strides)
    return Value(place.buffer.kind, shape, lambda index: Load(place.buffer, place.at(index)), place, free=True)


def scalar(expression: Expression, shape: Shape = ()) -> Value:
    """Return the value of one element that an expression gives."""
    return Value(expression.kind, shape, lambda _: expression, free=isinstance(expression, Name | Number))


def number(value: float | int | bool, kind: str) -> Value:
    """Return a literal."""
    return scalar(Number(value, kind))


class Block:
    """Statements of a function in the making, and names for what they define."""

    def __init__(self, names: dict[str, int] | None = None) -> None:
        self.statements: list[Statement] = []
        self._names = {} if names is None else names

    def inner(self) -> "Block":
        """Return an empty block inside this one."""
        return Block(self._names)

    def name(self, prefix: str) -> str:
        """Return a new name."""
        self._names[prefix] = number = self._names.get(prefix, 0) + 1
        return f"{prefix}{number}"

    def add(self, statement: Statement) -> None:
        """Append a statement."""
        self.statements.append(statement)

    def allocate(self, kind: str, size: int, cell: bool = False) -> Buffer:
        """Return a new buffer; `cell` makes it a variable."""
        buffer = Buffer(self.name("c" if cell else "a"), kind, size, cell)
        self.add(Allocate(buffer))
        return buffer

    def empty(self, kind: str, shape: Shape) -> Value:
        """Return a new array whose contents are undefined."""
        return placed(shape, Place(self.allocate(kind, prod(shape)), Number(0), contiguous(shape)))

    def let(self, expression: Expression) -> Expression:
        """Return the name of an expression's value, which is computed here."""
        if isinstance(expression, Name | Number):
            return expression
        name = Name(self.name("s"), expression.kind)
        self.add(Let(name, expression))
        return name

    def loops(self, shape: Shape) -> tuple[Index, "Block"]:
        """Return the index and the innermost block of loops over all elements of a shape; `close` them afterwards."""
        index = tuple(Number(0) if length == 1 else Name(self.name("i")) for length in shape)
        return index, self.inner()

    def close(self, index: Index, shape: Shape, innermost: "Block") -> None:
        """Append the loops that `loops` began."""
        body = innermost.statements
        for counter, length in reversed(list(zip(index, shape, strict=True))):
            if isinstance(counter, Name):
                body = [Loop(counter, length, tuple(body))]
        self.statements += body

    def variable(self, first: Expression) -> Buffer:
        """Return a new variable with a first value."""
        buffer = self.allocate(first.kind, 1, cell=True)
        self.add(Store(buffer, Number(0), first))
        return buffer

    def store(self, target: Value, index: Index, value: Expression) -> None:
        """Set an element of an array."""
        assert target.place is not None, "only what lies somewhere can be written"
        self.add(Store(target.place.buffer, target.place.at(index), value))

    def copy(self, value: Value, target: Value) -> None:
        """Store a value in an array of the same shape."""
        index, inner = self.loops(value.shape)
        inner.store(target, index, value.read(index))
        self.close(index, value.shape, inner)

    def stored(self, value: Value) -> Value:
        """Return the value as an array or a named scalar, computed here unless it is that already."""
        if value.place is not None:
            return value
        return scalar(self.let(value.first), value.shape) if value.size == 1 else self.copied(value)

    def copied(self, value: Value) -> Value:
        """Return a new array that holds a value."""
        target = self.empty(value.kind, value.shape)
        self.copy(value, target)
        return target

    def in_one_piece(self, value: Value) -> Value:
        """Return the value as an array that lies row by row."""
        return value if value.whole else self.copied(value)


def reshaped(value: Value, shape: Shape) -> Value:
    """Return an array that lies row by row, or one element, in another shape."""
    if value.place is not None and value.whole:
        return placed(shape, Place(value.place.buffer, value.place.offset, contiguous(shape)))
    assert value.size == 1, "only arrays in one piece have another shape"
    return Value(value.kind, shape, lambda _: value.first, free=value.free)


def moved(
    value: Value,
    shape: Shape,
    axes: Sequence[int | None],
    starts: Sequence[Expression] | None = None,
    steps: Sequence[int] | None = None,
) -> Value:
    """Return a value seen through other axes.

    Args:
        shape: the new shape.
        axes: for each axis of the value the new one that runs along it, or None.
        starts: the index along each axis of the value that the new index 0 stands for; 0 unless given.
        steps: by how much it grows; 1 unless given.
    """
    starts, steps = starts or [Number(0)] * len(axes), steps or [1] * len(axes)

    def read(index: Index) -> Expression:
        there = zip(axes, starts, steps, strict=True)
        return value.read(
            tuple(start if axis is None else plus(start, times(index[axis], step)) for axis, start, step in there)
        )

    if value.place is None:
        return Value(value.kind, shape, read, free=value.free)
    strides = [0] * len(shape)
    for axis, stride, step in zip(axes, value.place.strides, steps, strict=True):
        if axis is not None:
            strides[axis] += stride * step
    return placed(shape, Place(value.place.buffer, value.place.at(tuple(starts)), tuple(strides)))


def row_along(value: Value, step: Expression) -> Value:
    """Return one row of an array along its first axis."""
    rest = len(value.shape) - 1
    return moved(value, value.shape[1:], [None, *range(rest)], [step, *[Number(0)] * rest])


def part(value: Value, shape: tuple[int, ...], starts: Sequence[Expression]) -> Value:
    """Return the part of an array that begins at some index."""
    return moved(value, shape, range(len(shape)), starts)


def least(kind: str) -> float | int | bool:
    """Return the least number of a kind."""
    return False if kind == "bool" else -np.inf if kind == "float32" else int(np.iinfo(kind).min)


def greatest(kind: str) -> float | int | bool:
    """Return the greatest number of a kind."""
    return True if kind == "bool" else np.inf if kind == "float32" else int(np.iinfo(kind).max)
