"""A JAX function as a program over flat arrays, for a printer of some language.

The function is traced once, for arguments of certain shapes. Functions that it calls through `jit` stay functions if
they are of some size, loops stay loops, and whatever is not a loop becomes scalars and short loops over arrays.
"""

import inspect
import re
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, Var

from apollonius.export.control import CONTROL
from apollonius.export.equations import CALLED, RULES, length, line_of, needed, unknown_kind, waiting
from apollonius.export.program import Buffer, Call, Function, Load, Name, Number, Program, Slice
from apollonius.export.record import Leaf, Record, record_of
from apollonius.export.sweep import parts, swept
from apollonius.export.values import Block, Place, Value, contiguous, part, placed, scalar
from apollonius.io.errors import InvalidInput

_STAYS = 24
"""Equations that a called function must have at least to stay one."""


def translated(function: Callable[..., Any], *arguments: Any, name: str = "program", whole: bool = False) -> Program:
    """Return a JAX function as a program.

    Arguments become records, of what the program reads of them; those that have a result of their name, in a dict of
    results, whole, so that what comes out as `next_...` can be put in again.

    Args:
        arguments: pytrees of arrays or numbers of the shapes that the program shall take.
        name: what the program is called.
        whole: whether all records are whole, so that programs with the same arguments can share them.

    Raises:
        InvalidInput: for a primitive or a number type that cannot be translated, with the line that it comes from.
    """
    closed, shape = jax.make_jaxpr(function, return_shape=True)(*arguments)
    names = [*inspect.signature(function).parameters][: len(arguments)]
    records = [record_of(name, one) for name, one in zip(names, arguments, strict=True)]
    made = shape if isinstance(shape, dict) else {"result": shape}
    results = [record_of(f"next_{key}" if key in names else key, made[key]) for key in sorted(made)]
    return _Translator(name, whole).program(closed, records, results)


class _Translator:
    """Functions and constants found so far."""

    def __init__(self, name: str, whole: bool) -> None:
        self.name, self.whole = name, whole
        self.line = "line unknown"
        self.functions: dict[tuple[Any, ...], Function] = {}
        self.names = Counter[str]()
        self.constants: dict[tuple[Any, ...], tuple[Buffer, np.ndarray]] = {}

    def program(self, closed: ClosedJaxpr, arguments: Sequence[Record], results: Sequence[Record]) -> Program:
        """Return the program of a whole function."""
        block = Block()

        def values(records: Sequence[Record]) -> list[Value]:
            return [_of_leaf(record, leaf) for record in records for leaf in record.leaves]

        made = self.run(block, closed.jaxpr, closed.consts, values(arguments))
        for value, target in zip(made, values(results), strict=True):
            block.copy(value, target)
        entry = Function(self.name, (), (), swept(block.statements))
        used = {one.name for function in [*self.functions.values(), entry] for one in parts(function.body)}
        constants = tuple(one for one in self.constants.values() if one[0].name in used)
        read = {one.leaf for one in parts(entry.body) if isinstance(one, Buffer)}
        comes_back = {record.name.removeprefix("next_") for record in results}
        needed = [
            record
            if self.whole or record.name in comes_back
            else record.only({leaf for name, leaf in filter(None, read) if name == record.name})
            for record in arguments
        ]
        return Program(self.name, (*self.functions.values(), entry), constants, tuple(needed), tuple(results))

    def run(self, block: Block, jaxpr: Jaxpr, consts: Sequence[Any], given: Sequence[Value]) -> list[Value]:
        """Return the results of a function's equations, written to a block."""
        known: dict[Var, Value] = dict(zip(jaxpr.invars, given, strict=True))
        known |= {var: self.constant(const) for var, const in zip(jaxpr.constvars, consts, strict=True)}

        def value_of(one: Var | Literal) -> Value:
            return self.constant(one.val) if isinstance(one, Literal) else known[one]

        equations = needed(jaxpr)
        waits = waiting(jaxpr, equations)
        for equation in equations:
            results = self.equation(block, equation, [value_of(one) for one in equation.invars])
            for var, value in zip(equation.outvars, results, strict=True):
                known[var] = value if value.free or var in waits else block.stored(value)
        return [value_of(one) for one in jaxpr.outvars]

    def constant(self, value: Any) -> Value:
        """Return a literal, or an array that the function closes over."""
        array = np.asarray(value)
        array = array.astype(jax.dtypes.canonicalize_dtype(array.dtype))
        kind, shape = str(array.dtype), array.shape
        if array.size == 1:
            return scalar(Number(array.reshape(()).item(), kind), shape)
        key = (kind, shape, array.tobytes())
        if key not in self.constants:
            self.constants[key] = Buffer(f"k{len(self.constants) + 1}", kind, array.size), array
        return placed(shape, Place(self.constants[key][0], Number(0), contiguous(shape)))

    def equation(self, block: Block, equation: JaxprEqn, given: list[Value]) -> list[Value]:
        """Return the results of one equation.

        Raises:
            InvalidInput: for a primitive that is not known.
        """
        primitive, params = equation.primitive.name, equation.params
        self.line = line_of(equation) or self.line
        if kind := unknown_kind(equation):
            raise InvalidInput(f"numbers of the kind '{kind}' cannot be translated ({self.line}).")
        if primitive in CALLED:
            return self.call(block, params[CALLED[primitive]], given, str(params.get("name", primitive)))
        if primitive in CONTROL:
            ready = [value if value.free else block.stored(value) for value in given]
            return CONTROL[primitive](self.run, block, ready, params)
        if primitive == "optimization_barrier":
            return given
        if primitive == "split":
            return _split(given[0], params)
        if primitive not in RULES:
            raise InvalidInput(f"the primitive '{primitive}' cannot be translated ({self.line}).")
        try:
            return [RULES[primitive](block, given, params, equation.outvars[0].aval)]
        except NotImplementedError as reason:
            raise InvalidInput(f"'{primitive}' cannot be translated: {reason} ({self.line}).") from reason

    def call(self, block: Block, called: ClosedJaxpr | Jaxpr, given: Sequence[Value], name: str) -> list[Value]:
        """Return the results of a called function, which stays one if it is of some size."""
        jaxpr, consts = (called.jaxpr, called.consts) if isinstance(called, ClosedJaxpr) else (called, [])
        if length(jaxpr) < _STAYS:
            return self.run(block, jaxpr, consts, given)
        inside, parameters, arguments = Block(), [], []
        for value in map(_forward, [one if one.free and one.size == 1 else block.stored(one) for one in given]):
            if value.size == 1:
                parameters.append(Name(f"p{len(parameters) + 1}", value.kind))
                arguments.append((scalar(parameters[-1], value.shape), value.first))
            else:
                placed_at = (value if value.place is not None else block.in_one_piece(value)).place
                assert placed_at is not None
                reach = 1 + sum((n - 1) * stride for n, stride in zip(value.shape, placed_at.strides, strict=True))
                parameters.append(Buffer(f"p{len(parameters) + 1}", value.kind, reach, given=True))
                here = Place(parameters[-1], Number(0), placed_at.strides)
                arguments.append((placed(value.shape, here), Slice(placed_at.buffer, placed_at.offset)))
        results = self.run(inside, jaxpr, consts, [inner for inner, _ in arguments])
        targets = [
            Buffer(f"r{place}", value.kind, value.size, given=True) for place, value in enumerate(results, start=1)
        ]
        for value, target in zip(results, targets, strict=True):
            inside.copy(value, placed(value.shape, Place(target, Number(0), contiguous(value.shape))))
        body = swept(inside.statements)
        used = {one.name for one in parts(body)}
        kept = [one.name in used for one in parameters]
        signature = tuple(one for one, keep in zip(parameters, kept, strict=True) if keep), tuple(targets)
        key = (*signature, body)
        if key not in self.functions:
            word = re.sub(r"\W+", "_", name).strip("_").lower() or "function"
            self.names[word] += 1
            self.functions[key] = Function(f"{word}_{self.names[word]}", *signature, body)
        made = [block.empty(value.kind, value.shape) for value in results]
        passed = [argument for (_, argument), keep in zip(arguments, kept, strict=True) if keep]
        block.add(Call(self.functions[key].name, (*passed, *(_whole(value) for value in made))))
        return [block.stored(_loaded(value)) for value in made]


def _of_leaf(record: Record, leaf: Leaf) -> Value:
    buffer = Buffer(f"{record.name}_{leaf.name}".rstrip("_"), leaf.kind, leaf.size, leaf=(record.name, leaf.name))
    return placed(leaf.shape, Place(buffer, Number(0), contiguous(leaf.shape)))


def _split(value: Value, params: Any) -> list[Value]:
    pieces, start = [], 0
    for size in map(int, params["sizes"]):
        shape = tuple(size if axis == params["axis"] else n for axis, n in enumerate(value.shape))
        starts = [Number(start if axis == params["axis"] else 0) for axis in range(len(shape))]
        pieces.append(part(value, shape, starts))
        start += size
    return pieces


def _forward(value: Value) -> Value:
    """A value no stride of which is negative, computed where one is; a function's parameter begins at its first."""
    if value.place is not None and min(value.place.strides, default=0) < 0:
        return Value(value.kind, value.shape, value.read)
    return value


def _whole(value: Value) -> Slice:
    assert value.place is not None
    return Slice(value.place.buffer, Number(0))


def _loaded(value: Value) -> Value:
    """A lone number as an expression, since the buffer that a function wrote it to may be written again."""
    if value.size != 1 or value.place is None:
        return value
    return Value(value.kind, value.shape, lambda _, buffer=value.place.buffer: Load(buffer, Number(0)))
