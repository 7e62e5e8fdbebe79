"""A JAX function as a program in C.

The function is traced once, for arguments of certain shapes. Functions that it calls through `jit` stay functions if
they are of some size, and loops stay loops. Numbers become variables; what is computed for each element of an array is
computed where it is read if one primitive reads it, and stored otherwise.
"""

import inspect
import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, Var, jaxprs_in_params
from jax.interpreters.partial_eval import dce_jaxpr

from apollonius.export.arrays import CONTROL, FOLDS, OTHERS
from apollonius.export.block import Block, Value, buffer_of, placed, scalar
from apollonius.export.c import Program, words
from apollonius.export.elementwise import COMPUTED, VIEWS
from apollonius.export.indexing import INDEXED
from apollonius.export.names import require_name
from apollonius.export.record import Leaf, Record, record_of
from apollonius.export.scalars import TYPES, number
from apollonius.io.errors import InvalidInput, require

CALLED = {
    **{"jit": "jaxpr", "remat2": "jaxpr", "closed_call": "call_jaxpr"},
    **{"custom_jvp_call": "call_jaxpr", "custom_vjp_call": "call_jaxpr", "custom_vmap_call": "call"},
}
"""Primitives that call a function, and the parameter that is this function."""
RULES = COMPUTED | VIEWS | FOLDS | OTHERS | INDEXED
"""All others with one result, by name."""
_READS_ONCE = {*COMPUTED, *FOLDS, "squeeze", "transpose"}
"""Those that read each element of an operand once, if it is of their result's size or they fold it."""
_STAYS = 24
"""Equations that a called function must have at least to stay one."""
_LARGEST_CONSTANT = 1_000_000
"""Numbers of an array in the source, which takes 15 bytes for each."""
_LIBRARIES = f"{Path(jax.__file__).parents[1]}/"
"""The folder of JAX and of other libraries."""


def translated(function: Callable[..., Any], *arguments: Any, name: str = "program", whole: bool = False) -> Program:
    """Return a JAX function as a program; raises InvalidInput for a primitive or a number type that cannot be
    translated, with the line that it comes from.

    Arguments become records of the leaves that the program reads; those that have a result of their name, in a dict of
    results, are whole, so that what comes out as `next_...` can be put in again. All are where `whole` is given, so
    that programs with the same arguments can share them.
    """
    require_name("the program's name", name, is_public=True)
    names = _named(function, len(arguments))
    given = [record_of(name, one) for name, one in zip(names, arguments, strict=True)]
    closed, shape = jax.make_jaxpr(function, return_shape=True)(*arguments)
    translator, block = _Translator(), Block()
    values = translator.run(
        block, closed.jaxpr, closed.consts, [_of_leaf(one, leaf) for one in given for leaf in one.leaves]
    )
    shapes = shape if isinstance(shape, dict) else {"result": shape}
    results = [record_of(f"next_{key}" if key in names else str(key), shapes[key]) for key in sorted(shapes)]
    _require_names(name, given, results)
    targets = [_of_leaf(record, leaf, "*") for record in results for leaf in record.leaves]
    for value, target in zip(values, targets, strict=True):
        block.copy(value, target)
    body, comes_back = block.printed(), {record.name.removeprefix("next_") for record in results}
    kept = [record if whole or record.name in comes_back else record.only(words(body)) for record in given]
    called = translator.functions.items()
    functions = tuple(f"static void {title}({signature})\n{text}" for (signature, text), title in called)
    everything = words("".join([body, *functions]))
    constants = tuple(one for one in translator.constants.values() if one[0] in everything)
    return Program(name, functions, body, constants, tuple(kept), tuple(results))


def _named(function: Callable[..., Any], count: int) -> list[str]:
    """Return the names of a function's arguments; raises InvalidInput where there are fewer than are given."""
    parameters = inspect.signature(function).parameters.values()
    names = [one.name for one in parameters if one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD)]
    bound = f"at most {len(names)}, those that the function has a name for, since they have one in C"
    require(count <= len(names), "the number of arguments", count, bound)
    return names[:count]


def _require_names(name: str, given: Sequence[Record], results: Sequence[Record]) -> None:
    """Refuse, by InvalidInput, arguments and results that C cannot name so, beside each other and the structs."""
    uses = Counter(record.name for record in (*given, *results))
    for kind, records in (("an argument", given), ("a result", results)):
        for record in records:
            require_name(f"the name of {kind}", record.name)
            require(uses[record.name] == 1, f"the name of {kind}", record.name, "the name of no other: choose another")
            bound = f"one that does not begin with {name}_, as the names of structs do: choose another"
            require(not record.name.startswith(f"{name}_"), f"the name of {kind}", record.name, bound)
            require_name("the name of a struct", f"{name}_{record.name}", is_public=True)


class _Translator:
    """Functions and constants found so far."""

    def __init__(self) -> None:
        self.line = "line unknown"
        self.functions: dict[tuple[str, str], str] = {}
        self.names = Counter[str]()
        self.constants: dict[tuple[Any, ...], tuple[str, np.ndarray]] = {}

    def run(self, block: Block, jaxpr: Jaxpr, consts: Sequence[Any], given: Sequence[Value]) -> list[Value]:
        """Return the results of a function's equations, written to a block."""
        jaxpr, _ = dce_jaxpr(jaxpr, [True] * len(jaxpr.outvars), instantiate=True)
        known: dict[Var, Value] = dict(zip(jaxpr.invars, given, strict=True))
        known |= {var: self.constant(const) for var, const in zip(jaxpr.constvars, consts, strict=True)}

        def value_of(one: Var | Literal) -> Value:
            return self.constant(one.val) if isinstance(one, Literal) else known[one]

        waits = _waiting(jaxpr)
        for equation in jaxpr.eqns:
            try:
                results = self.equation(block, equation, [value_of(one) for one in equation.invars])
                for var, value in zip(equation.outvars, results, strict=True):
                    known[var] = value if var in waits else block.stored(value)
            except NotImplementedError as reason:
                message = f"'{equation.primitive.name}' cannot be translated: {reason} ({self.line})."
                raise InvalidInput(message) from reason
        return [value_of(one) for one in jaxpr.outvars]

    def constant(self, value: Any) -> Value:
        """Return a literal, or an array that the function closes over."""
        array = np.asarray(value)
        array = array.astype(jax.dtypes.canonicalize_dtype(array.dtype))
        kind, shape = str(array.dtype), array.shape
        if array.size <= 1:
            return scalar(kind, number(array.item() if array.size else 0, kind), shape)
        bound = f"of at most {_LARGEST_CONSTANT:,} numbers: make it an argument"
        require(array.size <= _LARGEST_CONSTANT, "the shape of a constant array", shape, bound)
        key = (kind, shape, array.tobytes())
        name, _ = self.constants.setdefault(key, (f"op_k{len(self.constants) + 1}", array))
        return placed(kind, shape, name)

    def equation(self, block: Block, equation: JaxprEqn, given: list[Value]) -> list[Value]:
        """Return the results of one equation; raises InvalidInput for a primitive that is not known."""
        primitive, params = equation.primitive.name, equation.params
        self.line = _line_of(equation) or self.line
        if kinds := {str(getattr(var.aval, "dtype", "?")) for var in equation.outvars} - {*TYPES}:
            raise InvalidInput(f"numbers of the kind '{min(kinds)}' cannot be translated ({self.line}).")
        outs: list[Any] = [var.aval for var in equation.outvars]
        if all(out.size == 0 for out in outs):
            return [scalar(str(out.dtype), "0", out.shape) for out in outs]
        if primitive in CALLED:
            return self.call(block, params[CALLED[primitive]], given, str(params.get("name", primitive)))
        if primitive in CONTROL:
            return CONTROL[primitive](self.run, block, given, params)
        if primitive in RULES:
            return [RULES[primitive](block, given, params, equation.outvars[0].aval)]
        raise InvalidInput(f"the primitive '{primitive}' cannot be translated ({self.line}).")

    def call(self, block: Block, called: ClosedJaxpr | Jaxpr, given: Sequence[Value], name: str) -> list[Value]:
        """Return the results of a called function, which stays one if it is of some size."""
        jaxpr, consts = (called.jaxpr, called.consts) if isinstance(called, ClosedJaxpr) else (called, [])
        if _length(jaxpr) < _STAYS:
            return self.run(block, jaxpr, consts, given)
        inside, inner, handed = Block(), list[Value](), dict[str, tuple[str, str]]()
        for number_in, value in enumerate(given, start=1):
            title, kind = f"_p{number_in}", TYPES[value.kind]
            if value.size == 1:
                inner.append(scalar(value.kind, title, value.shape))
                handed[title] = f"{kind} {title}", value.first
                continue
            place = value.place if value.place and min(value.place.strides) >= 0 else block.copied(value).place
            assert place is not None, "an array of several elements lies somewhere"
            inner.append(placed(value.kind, value.shape, title, strides=place.strides))
            start = "" if place.offset == "0" else f" + {place.offset}"
            handed[title] = f"const {kind} *{title}", f"{place.buffer}{start}"
        made = list[Value]()
        for number_out, value in enumerate(self.run(inside, jaxpr, consts, inner), start=1):
            made.append(block.array(value.kind, value.shape))
            inside.copy(value, placed(value.kind, value.shape, f"_r{number_out}"))
            handed[f"_r{number_out}"] = f"{TYPES[value.kind]} *restrict _r{number_out}", buffer_of(made[-1])
        text = inside.printed()
        kept = [both for word, both in handed.items() if word in words(text)]
        key = ", ".join(parameter for parameter, _ in kept), text
        if key not in self.functions:
            word = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_").lower() or "function"
            self.names[word] += 1
            self.functions[key] = f"op_{word}_{self.names[word]}"
        block.put(f"{self.functions[key]}({', '.join(argument for _, argument in kept)});")
        return made


def _of_leaf(record: Record, leaf: Leaf, pointer: str = "") -> Value:
    text = record.text(leaf)
    if leaf.size > 1:
        return placed(leaf.kind, leaf.shape, text)
    return scalar(leaf.kind, f"{pointer if record.lone else ''}{text}", leaf.shape)


def _waiting(jaxpr: Jaxpr) -> set[Var]:
    """Return the arrays that need not be stored: one equation reads them, each element once."""
    uses = Counter(var for equation in jaxpr.eqns for var in equation.invars if isinstance(var, Var))
    uses.update(var for var in jaxpr.outvars if isinstance(var, Var))
    wait = set()
    for equation in jaxpr.eqns:
        name = equation.primitive.name
        for var in equation.invars:
            if isinstance(var, Var) and uses[var] == 1 and name in _READS_ONCE and _size(var) > 1:
                wait |= {var} if name in FOLDS or _size(var) == _size(equation.outvars[0]) else set()
    return wait


def _size(var: Any) -> int:
    return var.aval.size


def _length(jaxpr: Jaxpr) -> int:
    """Return the number of equations, those of called functions and of loops included."""
    return sum(1 + sum(map(_length, jaxprs_in_params(equation.params))) for equation in jaxpr.eqns)


def _line_of(equation: JaxprEqn) -> str | None:
    """Return the line of Python that an equation comes from, outside of libraries; None if it is of one."""
    traceback = equation.source_info.traceback
    for frame in traceback.frames if traceback else ():
        if not frame.file_name.startswith(_LIBRARIES):
            return f"line {frame.line_num} of {frame.file_name}"
    return None
