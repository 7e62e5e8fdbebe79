"""Statements in the making, and the arrays that they read and write."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import prod

from apollonius.export.expression import TYPES, Expression, name, number, plus, times
from apollonius.export.statement import Line, Nest, words

Shape = tuple[int, ...]
Index = tuple[Expression, ...]


@dataclass(frozen=True)
class Buffer:
    """An array of one kind.

    Attributes:
        only: how its only element is written; empty if it is an array in C.
        outside: whether it outlives the function.
    """

    name: str
    kind: str
    size: int
    only: str = ""
    outside: bool = False

    def at(self, index: Expression) -> Expression:
        """Return an element."""
        return Expression(self.only or f"{self.name}[{index.text}]", self.kind)


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
        read: from an index, one expression for each axis, to the element there.
        place: where it lies; None if it is computed as it is read.
        free: whether reading it costs nothing, so that it need never be stored.
    """

    kind: str
    shape: Shape
    read: Callable[[Index], Expression]
    place: Place | None = None
    free: bool = False

    @property
    def size(self) -> int:
        """Return the number of elements."""
        return prod(self.shape)

    @property
    def first(self) -> Expression:
        """Return its first element, the only one of a lone number."""
        return self.read((number(0),) * len(self.shape))

    @property
    def whole(self) -> bool:
        """Return whether it lies somewhere in one piece, row by row."""
        return self.place is not None and (self.size == 1 or self.place.strides == contiguous(self.shape))


def contiguous(shape: Shape) -> tuple[int, ...]:
    """Return the strides of an array that lies row by row; 0 along axes of length 1."""
    return tuple(0 if length == 1 else prod(shape[axis + 1 :]) for axis, length in enumerate(shape))


def placed(shape: Shape, buffer: Buffer, offset: Expression | None = None, strides: Shape | None = None) -> Value:
    """Return the value that lies in a buffer, row by row from its beginning unless said otherwise."""
    both = zip(contiguous(shape) if strides is None else strides, shape, strict=True)
    place = Place(buffer, offset or number(0), tuple(0 if length == 1 else stride for stride, length in both))
    return Value(buffer.kind, shape, lambda index: buffer.at(place.at(index)), place, free=True)


def scalar(expression: Expression, shape: Shape = ()) -> Value:
    """Return the value of one element that an expression gives."""
    return Value(expression.kind, shape, lambda _: expression, free=expression.free)


class Block:
    """Statements of a function in the making, and names for what they define."""

    def __init__(self, names: dict[str, int] | None = None) -> None:
        self.statements: list[Line | Nest] = []
        self._names = {} if names is None else names

    def inner(self) -> "Block":
        """Return an empty block inside this one."""
        return Block(self._names)

    def name(self, prefix: str) -> str:
        """Return a new name."""
        self._names[prefix] = number = self._names.get(prefix, 0) + 1
        return f"{prefix}{number}"

    def allocate(self, kind: str, size: int, cell: bool = False) -> Buffer:
        """Return a new buffer, whose contents are undefined; `cell` makes it a variable."""
        called = self.name("c" if cell else "a")
        self.statements.append(Line(f"{TYPES[kind]} {called}{'' if cell else f'[{size}]'};", called))
        return Buffer(called, kind, size, called if cell else "")

    def empty(self, kind: str, shape: Shape) -> Value:
        """Return a new array whose contents are undefined."""
        return placed(shape, self.allocate(kind, prod(shape)))

    def let(self, expression: Expression) -> Expression:
        """Return the name of an expression's value, which is computed here."""
        if expression.free:
            return expression
        made = name(self.name("s"), expression.kind)
        text = f"const {TYPES[made.kind]} {made.text} = {expression.text};"
        self.statements.append(Line(text, made.text, words(expression.text)))
        return made

    def loops(self, shape: Shape) -> tuple[Index, "Block"]:
        """Return the index and the innermost block of loops over all elements of a shape; `close` them afterwards."""
        return tuple(number(0) if length == 1 else name(self.name("i")) for length in shape), self.inner()

    def close(self, index: Index, shape: Shape, innermost: "Block") -> None:
        """Append the loops that `loops` began."""
        body = innermost.statements
        for counter, length in reversed(list(zip(index, shape, strict=True))):
            if counter.known is None:
                step = counter.text
                body = [Nest(f"for (int32_t {step} = 0; {step} < {length}; {step}++)", tuple(body))]
        self.statements += body

    def set(self, buffer: Buffer, index: Expression, value: Expression) -> None:
        """Set an element of a buffer."""
        text, sets = f"{buffer.at(index).text} = {value.text};", "" if buffer.outside else buffer.name
        reads = words(index.text) | words(value.text)
        self.statements.append(Line(text, sets, reads if sets else reads | {buffer.name}))

    def variable(self, first: Expression) -> Buffer:
        """Return a new variable with a first value."""
        buffer = self.allocate(first.kind, 1, cell=True)
        self.set(buffer, number(0), first)
        return buffer

    def store(self, target: Value, index: Index, value: Expression) -> None:
        """Set an element of an array."""
        assert target.place is not None, "only what lies somewhere can be written"
        self.set(target.place.buffer, target.place.at(index), value)

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
    starts, steps = starts or [number(0)] * len(axes), steps or [1] * len(axes)

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
    return placed(shape, value.place.buffer, value.place.at(tuple(starts)), tuple(strides))


def row_along(value: Value, step: Expression) -> Value:
    """Return one row of an array along its first axis."""
    rest = len(value.shape) - 1
    return moved(value, value.shape[1:], [None, *range(rest)], [step, *[number(0)] * rest])


def part(value: Value, shape: Shape, starts: Sequence[Expression]) -> Value:
    """Return the part of an array that begins at some index."""
    return moved(value, shape, range(len(shape)), starts)
