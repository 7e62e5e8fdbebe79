"""A JAX function as a program in C.

The function is traced once, for arguments of certain shapes. Functions that it calls through `jit`
stay functions if they are of some size, and loops stay loops. Numbers become variables; what is
computed for each element of an array is computed where it is read if one primitive reads it, and
stored otherwise.
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

from jaxpr2c.arrays import FOLDS, MULTIPLE_READS
from jaxpr2c.block import Block, Value, buffer_of, scalar, value_at
from jaxpr2c.control import CONTROL
from jaxpr2c.elementwise import COMPUTED, VIEWS
from jaxpr2c.errors import Unsupported, require
from jaxpr2c.indexing import INDEXED
from jaxpr2c.names import require_name
from jaxpr2c.program import Program, c_names
from jaxpr2c.record import Leaf, Record, record_of
from jaxpr2c.scalars import TYPES, number

CALLED = {
    **{"jit": "jaxpr", "remat2": "jaxpr", "closed_call": "call_jaxpr"},
    **{
        "custom_jvp_call": "call_jaxpr",
        "custom_vjp_call": "call_jaxpr",
        "custom_vmap_call": "call",
    },
}
"""Primitives that call a function, and the parameter that is this function."""
RULES = COMPUTED | VIEWS | FOLDS | MULTIPLE_READS | INDEXED
"""All others with one result, by name."""
_READS_ONCE = {*COMPUTED, *FOLDS, "squeeze", "transpose"}
"""Primitives that read each element of an operand once, if it has their result's size or they fold
it.
"""
_LEAST_EQUATIONS = 24
"""Fewest equations of a called function that stays a function."""
_LARGEST_CONSTANT = 1_000_000
"""Numbers of an array in the source, which takes 15 bytes for each."""
_LIBRARIES = f"{Path(jax.__file__).parents[1]}/"
"""The folder of JAX and of other libraries."""


def translate(
    function: Callable[..., Any], *arguments: Any, name: str = "program", keep_unused: bool = False
) -> Program:
    """Translate a JAX function to a program in C99.

    Each argument is a parameter in C, of the function's name for it: a number, an array, or a
    struct of the leaves that the program reads. What the function returns is a parameter `result`,
    or one for each key of a dict. Where a key is an argument's name, the result is called
    `next_...`, and the argument has all of its leaves: the result can be the next call's argument.

    Args:
        function: The function.
        arguments: Example arguments, pytrees of arrays, of numbers or of `jax.ShapeDtypeStruct`.
        name: Name of the program, and of its function in C.
        keep_unused: Whether all arguments have all of their leaves, so that programs with the same
            arguments can share them.

    Raises:
        Unsupported: For a primitive or a number type that cannot be translated, with its line, and
            for a name that C cannot have.
    """
    require_name("the program's name", name, is_public=True)
    names = _argument_names(function, len(arguments))
    records = [record_of(name, argument) for name, argument in zip(names, arguments, strict=True)]
    closed_jaxpr, shape = jax.make_jaxpr(function, return_shape=True)(*arguments)
    translator = _Translator()
    block = Block()
    inputs = [_value_of_leaf(record, leaf) for record in records for leaf in record.leaves]
    values = translator.run(block, closed_jaxpr.jaxpr, closed_jaxpr.consts, inputs)
    shapes = shape if isinstance(shape, dict) else {"result": shape}
    result_names = {key: f"next_{key}" if key in names else str(key) for key in sorted(shapes)}
    results = [record_of(title, shapes[key]) for key, title in result_names.items()]
    _require_names(name, records, results)
    targets = [_value_of_leaf(record, leaf, "*") for record in results for leaf in record.leaves]
    for value, target in zip(values, targets, strict=True):
        block.copy(value, target)
    body = block.printed()
    returned_names = {record.name.removeprefix("next_") for record in results}
    body_words = c_names(body)
    arguments_read = [
        record if keep_unused or record.name in returned_names else record.only(body_words)
        for record in records
    ]
    functions_by_text = translator.functions.items()
    functions = tuple(
        f"static void {title}({signature})\n{text}"
        for (signature, text), title in functions_by_text
    )
    used_words = c_names("".join([body, *functions]))
    named_arrays = translator.constants.values()
    constants = tuple((title, array) for title, array in named_arrays if title in used_words)
    return Program(name, functions, body, constants, tuple(arguments_read), tuple(results))


def _argument_names(function: Callable[..., Any], count: int) -> list[str]:
    """Return the names of a function's arguments; raises Unsupported where there are fewer than
    are given.
    """
    parameters = inspect.signature(function).parameters.values()
    positional = inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD
    names = [parameter.name for parameter in parameters if parameter.kind in positional]
    bound = (
        f"at most {len(names)}, those that the function has a name for, since they have one in C"
    )
    require(count <= len(names), "the number of arguments", count, bound)
    return names[:count]


def _require_names(name: str, arguments: Sequence[Record], results: Sequence[Record]) -> None:
    """Refuse, by Unsupported, arguments and results that C cannot name so, beside each other and
    the structs.
    """
    uses = Counter(record.name for record in (*arguments, *results))
    for kind, records in (("an argument", arguments), ("a result", results)):
        for record in records:
            require_name(f"the name of {kind}", record.name)
            about = f"the name of {kind}"
            bound = "the name of no other: choose another"
            require(uses[record.name] == 1, about, record.name, bound)
            bound = (
                f"one that does not begin with {name}_, as the names of structs do: choose another"
            )
            require(not record.name.startswith(f"{name}_"), about, record.name, bound)
            require_name("the name of a struct", f"{name}_{record.name}", is_public=True)


class _Translator:
    """The functions and constants of a program under translation."""

    def __init__(self) -> None:
        self.line = "line unknown"
        self.functions: dict[tuple[str, str], str] = {}
        self.names = Counter[str]()
        self.constants: dict[tuple[Any, ...], tuple[str, np.ndarray]] = {}

    def run(
        self, block: Block, jaxpr: Jaxpr, consts: Sequence[Any], arguments: Sequence[Value]
    ) -> list[Value]:
        """Write a function's equations to a block; return their results.

        Args:
            block: Block to write in.
            jaxpr: The function.
            consts: Its constants.
            arguments: Its arguments.
        """
        jaxpr, _ = dce_jaxpr(jaxpr, [True] * len(jaxpr.outvars), instantiate=True)
        values: dict[Var, Value] = dict(zip(jaxpr.invars, arguments, strict=True))
        values |= {
            var: self.constant(const) for var, const in zip(jaxpr.constvars, consts, strict=True)
        }

        def value_of(variable: Var | Literal) -> Value:
            return (
                self.constant(variable.val) if isinstance(variable, Literal) else values[variable]
            )

        unstored = _unstored_arrays(jaxpr)
        for equation in jaxpr.eqns:
            try:
                results = self.equation(
                    block, equation, [value_of(variable) for variable in equation.invars]
                )
                for var, value in zip(equation.outvars, results, strict=True):
                    values[var] = value if var in unstored else block.as_stored(value)
            except NotImplementedError as reason:
                message = (
                    f"'{equation.primitive.name}' cannot be translated: {reason} ({self.line})."
                )
                raise Unsupported(message) from reason
        return [value_of(variable) for variable in jaxpr.outvars]

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
        return value_at(kind, shape, name)

    def equation(self, block: Block, equation: JaxprEqn, operands: list[Value]) -> list[Value]:
        """Write one equation; return its results.

        Raises:
            Unsupported: For a primitive without a rule.
        """
        primitive = equation.primitive.name
        params = equation.params
        self.line = _line_of(equation) or self.line
        kinds = {str(getattr(var.aval, "dtype", "?")) for var in equation.outvars}
        other_kinds = kinds - {*TYPES}
        if other_kinds:
            kind = min(other_kinds)
            raise Unsupported(f"numbers of the kind '{kind}' cannot be translated ({self.line}).")
        outs: list[Any] = [var.aval for var in equation.outvars]
        if all(out.size == 0 for out in outs):
            return [scalar(str(out.dtype), "0", out.shape) for out in outs]
        if primitive in CALLED:
            name = str(params.get("name", primitive))
            return self.call(block, params[CALLED[primitive]], operands, name)
        if primitive in CONTROL:
            return CONTROL[primitive](self.run, block, operands, params)
        if primitive in RULES:
            return [RULES[primitive](block, operands, params, equation.outvars[0].aval)]
        raise Unsupported(f"the primitive '{primitive}' cannot be translated ({self.line}).")

    def call(
        self, block: Block, function: ClosedJaxpr | Jaxpr, operands: Sequence[Value], name: str
    ) -> list[Value]:
        """Write a call, or the equations of a short function in its place; return the results.

        Args:
            block: Block to write in.
            function: The called function.
            operands: Its arguments.
            name: Its name in JAX.
        """
        is_closed = isinstance(function, ClosedJaxpr)
        jaxpr = function.jaxpr if is_closed else function
        consts = function.consts if is_closed else []
        if _count_equations(jaxpr) < _LEAST_EQUATIONS:
            return self.run(block, jaxpr, consts, operands)
        function_block = Block()
        function_inputs = list[Value]()
        parameters = dict[str, tuple[str, str]]()
        for number_in, value in enumerate(operands, start=1):
            title, kind = f"_p{number_in}", TYPES[value.kind]
            if value.size == 1:
                function_inputs.append(scalar(value.kind, title, value.shape))
                parameters[title] = f"{kind} {title}", value.first
                continue
            place = value.location
            if place is None or min(place.strides) < 0:
                place = block.copy_of(value).location
            assert place is not None, "an array of several elements lies somewhere"
            function_inputs.append(value_at(value.kind, value.shape, title, strides=place.strides))
            start = "" if place.offset == "0" else f" + {place.offset}"
            parameters[title] = f"const {kind} *{title}", f"{place.buffer}{start}"
        results = list[Value]()
        values = self.run(function_block, jaxpr, consts, function_inputs)
        for number_out, value in enumerate(values, start=1):
            title = f"_r{number_out}"
            results.append(block.array(value.kind, value.shape))
            function_block.copy(value, value_at(value.kind, value.shape, title))
            parameters[title] = f"{TYPES[value.kind]} *restrict {title}", buffer_of(results[-1])
        name_in_c, arguments = self._function(function_block.printed(), parameters, name)
        block.put(f"{name_in_c}({', '.join(arguments)});")
        return results

    def _function(
        self, text: str, parameters: dict[str, tuple[str, str]], name: str
    ) -> tuple[str, list[str]]:
        """Return the name in C of a function of this text, and the arguments of its call.

        `parameters` are the declaration and the argument of each parameter by its name in C.
        """
        used_parameters = [pair for word, pair in parameters.items() if word in c_names(text)]
        key = ", ".join(parameter for parameter, _ in used_parameters), text
        if key not in self.functions:
            word = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_").lower() or "function"
            self.names[word] += 1
            self.functions[key] = f"op_{word}_{self.names[word]}"
        return self.functions[key], [argument for _, argument in used_parameters]


def _value_of_leaf(record: Record, leaf: Leaf, pointer: str = "") -> Value:
    text = record.text(leaf)
    if leaf.size > 1:
        return value_at(leaf.kind, leaf.shape, text)
    return scalar(leaf.kind, f"{pointer if record.is_array else ''}{text}", leaf.shape)


def _unstored_arrays(jaxpr: Jaxpr) -> set[Var]:
    """Find the arrays that need not be stored, because one equation reads each of their elements
    once.
    """
    uses = Counter(
        var for equation in jaxpr.eqns for var in equation.invars if isinstance(var, Var)
    )
    uses.update(var for var in jaxpr.outvars if isinstance(var, Var))
    unstored = set()
    for equation in jaxpr.eqns:
        name = equation.primitive.name
        for var in equation.invars:
            if not isinstance(var, Var) or uses[var] > 1 or _size(var) <= 1:
                continue
            is_whole = name in FOLDS or _size(var) == _size(equation.outvars[0])
            if name in _READS_ONCE and is_whole:
                unstored.add(var)
    return unstored


def _size(var: Any) -> int:
    return var.aval.size


def _count_equations(jaxpr: Jaxpr) -> int:
    """Return the number of equations, those of called functions and of loops included."""
    return sum(
        1 + sum(map(_count_equations, jaxprs_in_params(equation.params))) for equation in jaxpr.eqns
    )


def _line_of(equation: JaxprEqn) -> str | None:
    """Return the line of Python that an equation comes from, outside of libraries; None if it is of
    one.
    """
    traceback = equation.source_info.traceback
    for frame in traceback.frames if traceback else ():
        if not frame.file_name.startswith(_LIBRARIES):
            return f"line {frame.line_num} of {frame.file_name}"
    return None
