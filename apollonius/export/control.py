"""Primitives of JAX that go by their data: loops that carry values, branches, and indices, kept within bounds."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np

from apollonius.export.block import Block, Value, part, placed, row_along, scalar
from apollonius.export.elementwise import Params, Rule, is_at_most
from apollonius.export.expression import Expression, apply, converted, number, plus
from apollonius.export.statement import Line, Nest, words

Run = Callable[[Block, Any, Sequence[Any], Sequence[Value]], list[Value]]
"""From a block to write in, a function, its constants and its arguments to its results."""


def scan(run: Run, block: Block, given: list[Value], params: Params) -> list[Value]:
    """Return the carry after the last step and what every step put out."""
    consts, carried = params["num_consts"], params["num_carry"]
    jaxpr, length = params["jaxpr"], params["length"]
    fixed, first, rows = given[:consts], given[consts : consts + carried], given[consts + carried :]
    carry = _variables(block, first)
    outs = jaxpr.jaxpr.outvars[carried:]
    ys = [block.empty(str(out.aval.dtype), (length, *out.aval.shape)) for out in outs]
    (step,), inner = block.loops((length,))
    here = apply("sub", "int32", number(length - 1), step) if params["reverse"] else step
    results = run(inner, jaxpr.jaxpr, jaxpr.consts, [*fixed, *carry, *(row_along(one, here) for one in rows)])
    for value, row in zip(results[carried:], ys, strict=True):
        inner.copy(value, row_along(row, here))
    _assign(inner, results[:carried], carry)
    block.close((step,), (length,), inner)
    return [*carry, *ys]


def while_loop(run: Run, block: Block, given: list[Value], params: Params) -> list[Value]:
    """Return the carry when the condition no longer holds."""
    asked, done = params["cond_nconsts"], params["body_nconsts"]
    carry = _variables(block, given[asked + done :])
    before, inner = block.inner(), block.inner()
    cond, body = params["cond_jaxpr"], params["body_jaxpr"]
    (holds,) = run(before, cond.jaxpr, cond.consts, [*given[:asked], *carry])
    _assign(inner, run(inner, body.jaxpr, body.consts, [*given[asked : asked + done], *carry]), carry)
    condition = holds.first.text
    leave = Line(f"if (!{condition})\n    break;", reads=words(condition))
    block.statements.append(Nest("for (;;)", (*before.statements, leave, *inner.statements)))
    return carry


def cond(run: Run, block: Block, given: list[Value], params: Params) -> list[Value]:
    """Return the results of the branch that is asked for; of the last one for a number beyond."""
    which, branches = block.let(given[0].read(())), params["branches"]
    made = [_variable(block, str(out.aval.dtype), out.aval.shape) for out in branches[0].jaxpr.outvars]

    def of_branch(place: int) -> Block:
        inner = block.inner()
        branch = branches[place]
        for value, target in zip(run(inner, branch.jaxpr, branch.consts, given[1:]), made, strict=True):
            inner.copy(value, target)
        return inner

    last = of_branch(len(branches) - 1)
    for place in range(len(branches) - 2, -1, -1):
        outer = block.inner()
        heading = f"if ({is_at_most(which, place).text})"
        outer.statements.append(Nest(heading, tuple(of_branch(place).statements), tuple(last.statements)))
        last = outer
    block.statements += last.statements
    return made


def _variable(block: Block, kind: str, shape: tuple[int, ...]) -> Value:
    """Return a value that can be assigned to."""
    if int(np.prod(shape, dtype=int)) != 1:
        return block.empty(kind, shape)
    return placed(shape, block.allocate(kind, 1, cell=True))


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
            return scalar(block.let(value.first), value.shape)
        return block.copied(value)

    ready = [apart(value, variable) for value, variable in zip(values, variables, strict=True)]
    for value, variable in zip(ready, variables, strict=True):
        if value.place != variable.place:
            block.copy(value, variable)


def _within(block: Block, start: Expression, most: int) -> Expression:
    """Return a start index between 0 and the last one with room behind it."""
    if start.known is not None or most <= 0:
        return number(min(max(int(start.known or 0), 0), max(most, 0)))
    above = apply("max", "int32", converted(start, "int32"), number(0))
    return block.let(apply("min", "int32", above, number(most)))


def _starts(block: Block, starts: Sequence[Value], shape: Sequence[int], sizes: Sequence[int]) -> list[Expression]:
    three = zip(starts, shape, sizes, strict=True)
    return [_within(block, start.read(()), length - size) for start, length, size in three]


def _dynamic_slice(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value, *starts = operands
    return part(block.stored(value), out.shape, _starts(block, starts, value.shape, out.shape))


def _dynamic_update_slice(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value, update, *starts = operands
    target = block.empty(value.kind, value.shape)
    block.copy(value, target)
    block.copy(update, part(target, update.shape, _starts(block, starts, value.shape, update.shape)))
    return target


def _gather(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value, indices = map(block.stored, operands)
    numbers, sizes = params["dimension_numbers"], params["slice_sizes"]
    target = block.empty(str(out.dtype), out.shape)
    index, inner = block.loops(out.shape)
    batch = [step for axis, step in enumerate(index) if axis not in numbers.offset_dims]
    offsets = iter([index[axis] for axis in numbers.offset_dims])
    gone = {*numbers.collapsed_slice_dims, *numbers.operand_batching_dims}
    there: list[Expression] = [number(0) if axis in gone else next(offsets) for axis in range(len(value.shape))]
    for axis, place in zip(numbers.operand_batching_dims, numbers.start_indices_batching_dims, strict=True):
        there[axis] = batch[place]
    known = number(True, "bool")
    for component, axis in enumerate(numbers.start_index_map):
        most = value.shape[axis] - sizes[axis]
        start = inner.let(converted(indices.read((*batch, number(component))), "int32"))
        for bound in (apply("ge", "bool", start, number(0)), apply("le", "bool", start, number(most))):
            known = bound if known.known else apply("and", "bool", known, bound)
        there[axis] = plus(there[axis], _within(inner, start, most))
    element = value.read(tuple(there))
    if params["mode"] == jax.lax.GatherScatterMode.FILL_OR_DROP:
        filler = np.asarray(params["fill_value"]).astype(value.kind).item()
        element = apply("select", value.kind, known, element, number(filler, value.kind))
    inner.store(target, index, element)
    block.close(index, out.shape, inner)
    return target


INDEXED: dict[str, Rule] = {
    "dynamic_slice": _dynamic_slice,
    "dynamic_update_slice": _dynamic_update_slice,
    "gather": _gather,
}

CONTROL = {"scan": scan, "while": while_loop, "cond": cond}
"""Rules of the primitives with results of several kinds, by name."""
