"""Arrays, and the statements that compute them, in the order in which they run."""

import functools
import re
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from math import prod

from jaxpr2c.scalars import TYPES, plus, times

Shape = tuple[int, ...]
Index = tuple[str, ...]
"""An expression in C for each axis."""
_NAME = re.compile(r"\b_s\d+\b")
_LET = re.compile(r" *const \w+ (_s\d+) =")


@dataclass(frozen=True)
class Location:
    """Part of an array in C: its name, the index of the part's first element, and how far
    neighbours along axes are.
    """

    buffer: str
    offset: str
    strides: tuple[int, ...]


@dataclass(frozen=True)
class Value:
    """An array that can be read: from an index to the element there, in C.

    Its kind is the name of its NumPy type; the elements of a `pending` one are computed as they are
    read.
    """

    kind: str
    shape: Shape
    read: Callable[[Index], str]
    location: Location | None = None
    pending: bool = False

    @property
    def size(self) -> int:
        return prod(self.shape)

    @property
    def first(self) -> str:
        """Return its first element, the only one of a lone number."""
        return self.read(("0",) * len(self.shape))


def _contiguous(shape: Shape) -> tuple[int, ...]:
    """Return the strides of an array that lies row by row; 0 along axes of length 1."""
    return tuple(0 if length == 1 else prod(shape[axis + 1 :]) for axis, length in enumerate(shape))


def value_at(
    kind: str, shape: Shape, buffer: str, offset: str = "0", strides: Shape | None = None
) -> Value:
    """Make the value of an array in C.

    Args:
        kind: Name of its NumPy type.
        shape: Its shape.
        buffer: Name of the array in C.
        offset: Index of the first element in `buffer`, in C.
        strides: Distance of neighbours along each axis; row by row for None.
    """
    place = Location(buffer, offset, _contiguous(shape) if strides is None else strides)

    def read(index: Index) -> str:
        return f"{buffer}[{functools.reduce(plus, map(times, index, place.strides), offset)}]"

    return Value(kind, shape, read, place)


def buffer_of(value: Value) -> str:
    """Return the name of the array in C that a value lies in; empty if it lies in none."""
    return value.location.buffer if value.location else ""


def scalar(kind: str, text: str, shape: Shape = ()) -> Value:
    """Return the value of one element that an expression gives."""
    return Value(kind, shape, lambda _: text)


def shift(
    value: Value,
    shape: Shape,
    axes: Sequence[int | None],
    starts: Sequence[str] | None = None,
    steps: Sequence[int] | None = None,
) -> Value:
    """Make a view of a value along other axes.

    Args:
        value: The value.
        shape: Shape of the view.
        axes: For each axis of the value the axis of the view that runs along it, or None.
        starts: Index in the value, in C, at index 0 of the view, for each axis; 0 for None.
        steps: Step in the value for a step in the view, for each axis; 1 for None.
    """
    starts = starts or ["0"] * len(axes)
    steps = steps or [1] * len(axes)

    def read(index: Index) -> str:
        axis_maps = zip(axes, starts, steps, strict=True)
        return value.read(
            tuple(
                start if axis is None else plus(start, times(index[axis], step))
                for axis, start, step in axis_maps
            )
        )

    if value.location is None:
        return Value(value.kind, shape, read, pending=value.pending)
    strides = [0] * len(shape)
    for axis, stride, step in zip(axes, value.location.strides, steps, strict=True):
        if axis is not None and shape[axis] != 1:
            strides[axis] += stride * step
    offset = functools.reduce(
        plus, map(times, starts, value.location.strides), value.location.offset
    )
    return value_at(value.kind, shape, value.location.buffer, offset, tuple(strides))


def row_along(value: Value, step: str) -> Value:
    """Return one row of an array along its first axis."""
    remaining_axes = len(value.shape) - 1
    return shift(
        value, value.shape[1:], [None, *range(remaining_axes)], [step, *["0"] * remaining_axes]
    )


def _defined(line: str) -> str:
    """Return the name of the constant that a statement defines; empty for other statements."""
    definition = _LET.match(line)
    return definition[1] if definition else ""


class Block:
    """The statements of a function, and names for what they define."""

    def __init__(self) -> None:
        self._lines = list[str]()
        self._depth = 1
        self._names = Counter[str]()

    def printed(self) -> str:
        """Return the statements in braces, without constants that nothing reads."""
        while True:
            uses = Counter(word for line in self._lines for word in _NAME.findall(line))
            unread = {name for name, count in uses.items() if count == 1}
            lines = [line for line in self._lines if _defined(line) not in unread]
            if len(lines) == len(self._lines):
                return "\n".join(["{", *lines, "}"])
            self._lines = lines

    def put(self, statement: str) -> None:
        self._lines.append("    " * self._depth + statement)

    def name(self, prefix: str) -> str:
        self._names[prefix] += 1
        return f"{prefix}{self._names[prefix]}"

    def let(self, kind: str, text: str) -> str:
        """Return the name of the value that an expression has here."""
        return text if re.fullmatch(r"\w+", text) else self.variable(kind, text, "const ")

    def variable(self, kind: str, first: str, const: str = "") -> str:
        """Return the name of a new variable with a first value."""
        name = self.name("_s")
        self.put(f"{const}{TYPES[kind]} {name} = {first};")
        return name

    def array(self, kind: str, shape: Shape) -> Value:
        """Return a new array whose contents are undefined."""
        name = self.name("_a")
        self.put(f"{TYPES[kind]} {name}[{max(1, prod(shape))}];")
        return value_at(kind, shape, name)

    @contextmanager
    def braces(self, heading: str) -> Generator[None]:
        """Open what a loop or a choice does; statements within the context belong to it."""
        self.put(f"{heading} {{")
        self._depth += 1
        yield
        self._depth -= 1
        self.put("}")

    @contextmanager
    def loops(self, shape: Shape) -> Generator[Index]:
        """Open loops over all elements of a shape, and return the index."""
        with ExitStack() as nest:
            index = tuple("0" if length == 1 else self.name("_i") for length in shape)
            for step, length in zip(index, shape, strict=True):
                if length != 1:
                    heading = f"for (int32_t {step} = 0; {step} < {length}; {step}++)"
                    nest.enter_context(self.braces(heading))
            yield index

    def copy(self, value: Value, target: Value) -> None:
        """Store a value in an array of the same shape."""
        with self.loops(value.shape) as index:
            self.put(f"{target.read(index)} = {value.read(index)};")

    def new_array(self, value: Value) -> Value:
        """Return a new array with the contents of a value."""
        target = self.array(value.kind, value.shape)
        self.copy(value, target)
        return target

    def copy_of(self, value: Value) -> Value:
        """Return a new array that holds a value; of one element a constant."""
        if value.size == 1:
            return scalar(value.kind, self.let(value.kind, value.first), value.shape)
        return self.new_array(value)

    def as_stored(self, value: Value) -> Value:
        """Return the value, its elements computed here unless they are known."""
        return self.copy_of(value) if value.pending else value

    def as_contiguous(self, value: Value) -> Value:
        """Return the value as one that lies in an array in C row by row; a number as it is."""
        strides = value.location.strides if value.location else None
        is_whole = value.size == 1 or strides == _contiguous(value.shape)
        return value if is_whole else self.copy_of(value)
