"""A JAX function as a program in C.

The function is traced once, for arguments of certain shapes. Functions that it calls through `jit` stay functions if
they are of some size, loops stay loops, and whatever is not a loop becomes scalars and short loops over arrays.
"""

import inspect
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, Var

from apollonius.export.block import Block, Buffer, Value, part, placed, scalar
from apollonius.export.c import Program
from apollonius.export.control import CONTROL
from apollonius.export.equations import CALLED, RULES, length, line_of, needed, unknown_kind, waiting
from apollonius.export.expression import TYPES, number
from apollonius.export.expression import name as named
from apollonius.export.record import Leaf, Record, record_of
from apollonius.export.statement import Line, printed, swept, words
from apollonius.io.errors import InvalidInput

_STAYS = 24
"""Equations that a called function must have at least to stay one."""


def translated(function: Callable[..., Any], *arguments: Any, name: str = "program", whole: bool = False) -> Program:
    """Return a JAX function as a program.

    Arguments become records of the leaves that the program reads; those that have a result of their name, in a dict of
    results, are whole, so that what comes out as `next_...` can be put in again.

    Args:
        arguments: pytrees of arrays or numbers of the shapes that the program shall take.
        name: what the program is called.
        whole: whether all records are whole, so that programs with the same arguments can share them.

    Raises:
        InvalidInput: for a primitive or a number type that cannot be translated, with the line that it comes from.
    """
    closed, shape = jax.make_jaxpr(function, return_shape=True)(*arguments)
    names = [*inspect.signature(function).parameters][: len(arguments)]
    given = [record_of(name, one) for name, one in zip(names, arguments, strict=True)]
    made = shape if isinstance(shape, dict) else {"result": shape}
    results = [record_of(f"next_{key}" if key in names else key, made[key]) for key in sorted(made)]
    translator, block = _Translator(), Block()
    read = [_of_leaf(record, leaf, record.name) for record in given for leaf in record.leaves]
    targets = [_of_leaf(record, leaf, f"*{record.name}") for record in results for leaf in record.leaves]
    for value, target in zip(translator.run(block, closed.jaxpr, closed.consts, read), targets, strict=True):
        block.copy(value, target)
    body = printed(swept(block.statements))
    used, comes_back = words(body), {record.name.removeprefix("next_") for record in results}
    kept = [record if whole or record.name in comes_back else record.only(used) for record in given]
    called = translator.functions.items()
    functions = tuple(f"static void {title}({signature})\n{text}" for (signature, text), title in called)
    everything = used.union(*map(words, functions))
    constants = tuple(one for one in translator.constants.values() if one[0].name in everything)
    return Program(name, functions, body, constants, tuple(kept), tuple(results))


class _Translator:
    """Functions and constants found so far."""

    def __init__(self) -> None:
        self.line = "line unknown"
        self.functions: dict[tuple[str, str], str] = {}
        self.names = Counter[str]()
        self.constants: dict[tuple[Any, ...], tuple[Buffer, np.ndarray]] = {}

    def run(self, block: Block, jaxpr: Jaxpr, consts: Sequence[Any], given: Sequence[Value]) -> list[Value]:
        """Return the results of a function's equations, written to a block."""
        known: dict[Var, Value] = dict(zip(jaxpr.invars, given, strict=True))
        known |= {var: self.constant(const) for var, const in zip(jaxpr.constvars, consts, strict=True)}

        def value_of(one: Var | Literal) -> Value:
            return self.constant(one.val) if isinstance(one, Literal) else known[one]

        equations = needed(jaxpr)
        waits = waiting(jaxpr, equations)
        for equation in equations:
            try:
                results = self.equation(block, equation, [value_of(one) for one in equation.invars])
                for var, value in zip(equation.outvars, results, strict=True):
                    known[var] = value if value.free or var in waits else block.stored(value)
            except NotImplementedError as reason:
                message = f"'{equation.primitive.name}' cannot be translated: {reason} ({self.line})."
                raise InvalidInput(message) from reason
        return [value_of(one) for one in jaxpr.outvars]

    def constant(self, value: Any) -> Value:
        """Return a literal, or an array that the function closes over."""
        array = np.asarray(value)
        array = array.astype(jax.dtypes.canonicalize_dtype(array.dtype))
        kind, shape = str(array.dtype), array.shape
        if array.size == 1:
            return scalar(number(array.reshape(()).item(), kind), shape)
        key = (kind, shape, array.tobytes())
        if key not in self.constants:
            self.constants[key] = Buffer(f"k{len(self.constants) + 1}", kind, array.size), array
        return placed(shape, self.constants[key][0])

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
        return [RULES[primitive](block, given, params, equation.outvars[0].aval)]

    def call(self, block: Block, called: ClosedJaxpr | Jaxpr, given: Sequence[Value], name: str) -> list[Value]:
        """Return the results of a called function, which stays one if it is of some size."""
        jaxpr, consts = (called.jaxpr, called.consts) if isinstance(called, ClosedJaxpr) else (called, [])
        if length(jaxpr) < _STAYS:
            return self.run(block, jaxpr, consts, given)
        inside, inner, parameters, arguments = Block(), list[Value](), list[str](), list[str]()
        for value in map(_forward, [one if one.free and one.size == 1 else block.stored(one) for one in given]):
            parameter, kind = f"p{len(inner) + 1}", TYPES[value.kind]
            if value.size == 1:
                inner.append(scalar(named(parameter, value.kind), value.shape))
                parameters.append(f"{kind} {parameter}")
                arguments.append(value.first.text)
            else:
                place = (value if value.place is not None else block.copied(value)).place
                assert place is not None
                inner.append(placed(value.shape, Buffer(parameter, value.kind, value.size), strides=place.strides))
                parameters.append(f"const {kind} *{parameter}")
                start = "" if place.offset.known == 0 else f" + {place.offset.text}"
                arguments.append(f"{place.buffer.name}{start}")
        results, written = self.run(inside, jaxpr, consts, inner), list[str]()
        for place, value in enumerate(results, start=1):
            target = Buffer(f"r{place}", value.kind, value.size, outside=True)
            inside.copy(value, placed(value.shape, target))
            written.append(f"{TYPES[value.kind]} *restrict {target.name}")
        body = printed(swept(inside.statements))
        kept = [place for place in range(len(inner)) if f"p{place + 1}" in words(body)]
        signature = ", ".join([*(parameters[place] for place in kept), *written])
        key = signature, body
        if key not in self.functions:
            word = re.sub(r"\W+", "_", name).strip("_").lower() or "function"
            self.names[word] += 1
            self.functions[key] = f"{word}_{self.names[word]}"
        made = [block.empty(value.kind, value.shape) for value in results]
        passed = [*(arguments[place] for place in kept), *(_buffer(value).name for value in made)]
        text = f"{self.functions[key]}({', '.join(passed)});"
        block.statements.append(Line(text, reads=words(text)))
        return [block.stored(_loaded(value)) for value in made]


def _of_leaf(record: Record, leaf: Leaf, only: str = "") -> Value:
    text = record.text(leaf)
    outside = Buffer(text, leaf.kind, leaf.size, only if record.lone else text, outside=True)
    return placed(leaf.shape, outside if leaf.size == 1 else replace(outside, only=""))


def _split(value: Value, params: Any) -> list[Value]:
    pieces, start = [], 0
    for size in map(int, params["sizes"]):
        shape = tuple(size if axis == params["axis"] else n for axis, n in enumerate(value.shape))
        starts = [number(start if axis == params["axis"] else 0) for axis in range(len(shape))]
        pieces.append(part(value, shape, starts))
        start += size
    return pieces


def _forward(value: Value) -> Value:
    """Return a value without negative strides, computed where one is: a function's parameter begins at its first."""
    if value.place is not None and min(value.place.strides, default=0) < 0:
        return Value(value.kind, value.shape, value.read)
    return value


def _buffer(value: Value) -> Buffer:
    assert value.place is not None
    return value.place.buffer


def _loaded(value: Value) -> Value:
    """Return a lone number as an expression, since the buffer that a function wrote it to may be written again."""
    return value if value.size != 1 else Value(value.kind, value.shape, lambda _, first=value.first: first)
