"""A JAX function as a program over flat arrays, for a printer of some language.

The function is traced once, for arguments of certain shapes. Functions that it calls through `jit` stay functions if
they are of some size, loops stay loops, and whatever is not a loop becomes scalars and short loops over arrays.
"""

import inspect
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, Var

from apollonius.errors import InvalidInput
from apollonius.export.primitives import ELEMENTWISE, RULES
from apollonius.export.program import (
    Apply,
    Branch,
    Buffer,
    Call,
    Expression,
    Function,
    Leaf,
    Load,
    Loop,
    Name,
    Number,
    Program,
    Record,
    Slice,
    Store,
    While,
    parts,
    swept,
)
from apollonius.export.values import Block, Place, Value, contiguous, moved, placed, scalar

_STAYS = 24
"""Equations that a called function must have at least to stay one."""
_CALLED = {
    "jit": "jaxpr",
    "closed_call": "call_jaxpr",
    "remat": "jaxpr",
    "checkpoint": "jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
    "custom_vmap_call": "call",
}
"""Primitives that call a function, and the parameter that is this function."""
_READS_ONCE = ELEMENTWISE | {"concatenate", "stack", "squeeze", "transpose", "expand_dims"} | {
    name for name in RULES if name.startswith(("reduce_", "cum", "arg"))
}
"""Primitives that read each element of an operand of the size of their result, or of one that they fold, once."""


def translated(function: Callable[..., Any], *arguments: Any, name: str = "program") -> Program:
    """Return a JAX function as a program.

    Args:
        arguments: pytrees of arrays or numbers of the shapes that the program shall take.
        name: what the program is called.

    Raises:
        InvalidInput: for a primitive or a number type that cannot be translated, with the line that it comes from.
    """
    closed, shape = jax.make_jaxpr(function, return_shape=True)(*arguments)
    names = [*inspect.signature(function).parameters][: len(arguments)]
    records = [_record(name, one) for name, one in zip(names, arguments, strict=True)]
    made = shape if isinstance(shape, dict) else {"result": shape}
    results = [_record(f"next_{key}" if key in names else key, made[key]) for key in sorted(made)]
    return _Translator(name).program(closed, records, results)


def _record(name: str, tree: Any) -> Record:
    found, leaves = Counter[str](), []
    for path, leaf in jax.tree_util.tree_flatten_with_path(tree)[0]:
        words = "_".join(re.findall(r"[^\W_]+", jax.tree_util.keystr(path))).lower()
        called = f"value_{words}" if words[:1].isdigit() else words
        found[called] += 1
        kind = str(jax.dtypes.canonicalize_dtype(jax.numpy.result_type(leaf)))
        unique = called if found[called] == 1 else f"{called}_{found[called]}"
        leaves.append((unique, kind, tuple(np.shape(leaf))))
    return Record.of(name, leaves)


class _Translator:
    """Functions and constants found so far."""

    def __init__(self, name: str) -> None:
        self.name = name
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
        used = {part.name for function in [*self.functions.values(), entry] for part in parts(function.body)}
        constants = tuple(one for one in self.constants.values() if one[0].name in used)
        return Program(self.name, (*self.functions.values(), entry), constants, tuple(arguments), tuple(results))

    def run(self, block: Block, jaxpr: Jaxpr, consts: Sequence[Any], given: Sequence[Value]) -> list[Value]:
        """Return the results of a function's equations, written to a block."""
        known: dict[Var, Value] = dict(zip(jaxpr.invars, given, strict=True))
        known |= {var: self.constant(const) for var, const in zip(jaxpr.constvars, consts, strict=True)}

        def value_of(one: Var | Literal) -> Value:
            return self.constant(one.val) if isinstance(one, Literal) else known[one]

        needed = _needed(jaxpr)
        waits = _waiting(jaxpr, needed)
        for equation in needed:
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
        for var in equation.outvars:
            _check_kind(var, equation)
        if primitive in _CALLED:
            called = params[_CALLED[primitive]]
            return self.call(block, called, given, str(params.get("name", primitive)))
        if primitive in ("scan", "while", "cond"):
            ready = [value if value.free else block.stored(value) for value in given]
            return getattr(self, f"_{primitive}")(block, ready, params)
        if primitive == "optimization_barrier":
            return given
        if primitive == "split":
            return _split(given[0], params)
        if primitive not in RULES:
            raise InvalidInput(f"the primitive '{primitive}' cannot be translated ({_line_of(equation)}).")
        try:
            return [RULES[primitive](block, given, params, equation.outvars[0].aval)]
        except NotImplementedError as reason:
            raise InvalidInput(f"'{primitive}' cannot be translated: {reason} ({_line_of(equation)}).") from reason

    def call(self, block: Block, called: ClosedJaxpr | Jaxpr, given: Sequence[Value], name: str) -> list[Value]:
        """Return the results of a called function, which stays one if it is of some size."""
        jaxpr, consts = (called.jaxpr, called.consts) if isinstance(called, ClosedJaxpr) else (called, [])
        if _equations(jaxpr) < _STAYS:
            return self.run(block, jaxpr, consts, given)
        inside, parameters, arguments = Block(), [], []
        for value in map(_forward, [one if one.free and one.size == 1 else block.stored(one) for one in given]):
            if value.size == 1:
                parameters.append(Name(f"p{len(parameters) + 1}", value.kind))
                arguments.append((scalar(parameters[-1], value.shape), value.read((Number(0),) * len(value.shape))))
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
        used = {part.name for part in parts(body)}
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

    def _scan(self, block: Block, given: list[Value], params: Any) -> list[Value]:
        """Return the carry after the last step and what every step put out."""
        consts, carried = params["num_consts"], params["num_carry"]
        jaxpr, length = params["jaxpr"], params["length"]
        fixed, first, rows = given[:consts], given[consts : consts + carried], given[consts + carried :]
        carry = _variables(block, first)
        outs = jaxpr.jaxpr.outvars[carried:]
        ys = [block.empty(str(out.aval.dtype), (length, *out.aval.shape)) for out in outs]
        (step,), inner = block.loops((length,)) if length != 1 else ((Number(0),), block.inner())
        here: Expression = step
        if params["reverse"]:
            here = Apply("sub", "int32", (Number(length - 1), step)) if length != 1 else Number(0)
        results = self.run(inner, jaxpr.jaxpr, jaxpr.consts, [*fixed, *carry, *(_row(one, here) for one in rows)])
        for value, row in zip(results[carried:], ys, strict=True):
            inner.copy(value, _row(row, here))
        _assign(inner, results[:carried], carry)
        block.add(Loop(step, length, tuple(inner.statements))) if isinstance(step, Name) else block.close((), (), inner)
        return [*carry, *ys]

    def _while(self, block: Block, given: list[Value], params: Any) -> list[Value]:
        """Return the carry when the condition no longer holds."""
        asked, done = params["cond_nconsts"], params["body_nconsts"]
        carry = _variables(block, given[asked + done :])
        before, inner = block.inner(), block.inner()
        cond, body = params["cond_jaxpr"], params["body_jaxpr"]
        (holds,) = self.run(before, cond.jaxpr, cond.consts, [*given[:asked], *carry])
        _assign(inner, self.run(inner, body.jaxpr, body.consts, [*given[asked : asked + done], *carry]), carry)
        block.add(While(tuple(before.statements), holds.read(()), tuple(inner.statements)))
        return carry

    def _cond(self, block: Block, given: list[Value], params: Any) -> list[Value]:
        """Return the results of the branch that is asked for; of the last one for a number beyond."""
        which, branches = block.let(given[0].read(())), params["branches"]
        made = [_variable(block, str(out.aval.dtype), out.aval.shape) for out in branches[0].jaxpr.outvars]

        def of_branch(place: int) -> Block:
            inner = block.inner()
            branch = branches[place]
            for value, target in zip(self.run(inner, branch.jaxpr, branch.consts, given[1:]), made, strict=True):
                inner.copy(value, target)
            return inner

        last = of_branch(len(branches) - 1)
        for place in range(len(branches) - 2, -1, -1):
            is_it = (
                Apply("not", "bool", (which,)) if which.kind == "bool"
                else Apply("le", "bool", (which, Number(place, which.kind)))
            )
            outer = block.inner()
            outer.add(Branch(is_it, tuple(of_branch(place).statements), tuple(last.statements)))
            last = outer
        block.statements += last.statements
        return made


def _of_leaf(record: Record, leaf: Leaf) -> Value:
    buffer = Buffer(f"{record.name}_{leaf.name}".rstrip("_"), leaf.kind, leaf.size, leaf=(record.name, leaf.name))
    return placed(leaf.shape, Place(buffer, Number(0), contiguous(leaf.shape)))


def _variable(block: Block, kind: str, shape: tuple[int, ...]) -> Value:
    """A value that can be assigned to."""
    if int(np.prod(shape, dtype=int)) != 1:
        return block.empty(kind, shape)
    return placed(shape, Place(block.allocate(kind, 1, cell=True), Number(0), (0,) * len(shape)))


def _variables(block: Block, first: Sequence[Value]) -> list[Value]:
    made = [_variable(block, value.kind, value.shape) for value in first]
    for value, variable in zip(first, made, strict=True):
        block.copy(value, variable)
    return made


def _assign(block: Block, values: Sequence[Value], variables: Sequence[Value]) -> None:
    """Assign all at once: what reads another variable is copied before that one changes."""
    changing = {variable.place.buffer.name for variable in variables if variable.place is not None}

    def apart(value: Value, variable: Value) -> Value:
        if value.place is None:
            return value
        if value.place == variable.place or value.place.buffer.name not in changing:
            return value
        if value.size == 1:
            return scalar(block.let(value.read((Number(0),) * len(value.shape))), value.shape)
        copied = block.empty(value.kind, value.shape)
        block.copy(value, copied)
        return copied

    ready = [apart(value, variable) for value, variable in zip(values, variables, strict=True)]
    for value, variable in zip(ready, variables, strict=True):
        if value.place != variable.place:
            block.copy(value, variable)


def _row(value: Value, step: Expression) -> Value:
    """One row along the first axis."""
    axes: list[int | None] = [None, *range(len(value.shape) - 1)]
    starts = [step, *[Number(0)] * (len(value.shape) - 1)]
    return moved(value, value.shape[1:], axes, starts, [1] * len(value.shape))


def _split(value: Value, params: Any) -> list[Value]:
    pieces, start = [], 0
    for size in params["sizes"]:
        shape = tuple(size if axis == params["axis"] else n for axis, n in enumerate(value.shape))
        starts = [Number(start if axis == params["axis"] else 0) for axis in range(len(shape))]
        pieces.append(moved(value, shape, range(len(shape)), starts, [1] * len(shape)))
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


def _needed(jaxpr: Jaxpr) -> list[JaxprEqn]:
    """The equations that the results depend on."""
    wanted, found = {var for var in jaxpr.outvars if isinstance(var, Var)}, []
    for equation in reversed(jaxpr.eqns):
        if wanted.intersection(equation.outvars):
            found.append(equation)
            wanted |= {var for var in equation.invars if isinstance(var, Var)}
    return found[::-1]


def _waiting(jaxpr: Jaxpr, equations: Sequence[JaxprEqn]) -> set[Var]:
    """The arrays that need not be stored: one equation reads them, each element once."""
    uses = Counter(var for equation in equations for var in equation.invars if isinstance(var, Var))
    uses.update(var for var in jaxpr.outvars if isinstance(var, Var))
    wait = set()
    for equation in equations:
        for var in equation.invars:
            if not isinstance(var, Var) or uses[var] != 1 or equation.primitive.name not in _READS_ONCE:
                continue
            folds = equation.primitive.name.startswith(("reduce_", "cum", "arg", "concatenate", "stack"))
            if var.aval.size > 1 and (folds or var.aval.size == equation.outvars[0].aval.size):
                wait.add(var)
    return wait


def _equations(jaxpr: Jaxpr) -> int:
    """Number of equations, those of called functions and of loops included."""
    return sum(1 + sum(_equations(inner) for inner in _inner(equation)) for equation in jaxpr.eqns)


def _inner(equation: JaxprEqn) -> Iterator[Jaxpr]:
    for value in equation.params.values():
        for one in value if isinstance(value, tuple | list) else (value,):
            if isinstance(one, ClosedJaxpr | Jaxpr):
                yield one.jaxpr if isinstance(one, ClosedJaxpr) else one


_KINDS = {"float32", "int32", "uint32", "bool", "uint8", "uint16", "int8", "int16"}


def _check_kind(var: Any, equation: JaxprEqn) -> None:
    kind = str(getattr(var.aval, "dtype", "?"))
    if kind not in _KINDS:
        raise InvalidInput(f"numbers of the kind '{kind}' cannot be translated ({_line_of(equation)}).")


def _line_of(equation: JaxprEqn) -> str:
    """The line of Python that an equation comes from."""
    traceback, library = equation.source_info.traceback, Path(jax.__file__).parent
    for frame in traceback.frames if traceback else ():
        if library not in Path(frame.file_name).parents and "equinox" not in frame.file_name:
            return f"line {frame.line_num} of {frame.file_name}"
    return "line unknown"
