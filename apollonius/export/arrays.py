"""Primitives of JAX that are loops or branches: joining, folding along axes, products of matrices, control flow."""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from math import prod
from typing import Any

import numpy as np

from apollonius.export.block import Block, Index, Value, buffer_of, moved, row_along, scalar
from apollonius.export.elementwise import Params, Rule, is_at_most
from apollonius.export.indexing import part
from apollonius.export.scalars import apply, converted, number

_WORTH_A_TEST = 8
"""Length of the inner loop of a product from which on a factor of 0 is looked for."""


def _joined(block: Block, pieces: Sequence[Value], axis: int, out: Any) -> Value:
    target, start = block.array(str(out.dtype), out.shape), 0
    for piece in pieces:
        block.copy(piece, part(target, piece.shape, [str(start * (here == axis)) for here in range(len(out.shape))]))
        start += piece.shape[axis]
    return target


def _stack(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    axis = int(params["axis"]) % len(out.shape)
    shape = tuple(1 if here == axis else length for here, length in enumerate(out.shape))
    axes = [here for here in range(len(shape)) if here != axis]
    return _joined(block, [moved(one, shape, axes) for one in operands], axis, out)


def _pad(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value, filler = operands
    low, high, gaps = ([int(config[place]) for config in params["padding_config"]] for place in range(3))
    if min(*low, *high) < 0:
        raise NotImplementedError("by less than nothing")
    target = block.filled(moved(filler, out.shape, []))
    block.copy(value, moved(target, value.shape, range(len(low)), list(map(str, low)), [gap + 1 for gap in gaps]))
    return target


def _extreme(kind: str, sign: int) -> float | int | bool:
    """Return the least number of a kind, or for a sign of 1 the greatest."""
    if kind in ("bool", "float32"):
        return sign > 0 if kind == "bool" else sign * np.inf
    return int(np.iinfo(kind).max if sign > 0 else np.iinfo(kind).min)


def _neutral(operation: str, kind: str) -> str:
    """Return the neutral element of an operation that folds, in C."""
    if operation in ("max", "min"):
        return number(_extreme(kind, -1 if operation == "max" else 1), kind)
    return number(-1 if operation == "and" and kind != "bool" else operation in ("mul", "and"), kind)


def _inserted(index: Sequence[str], axes: Sequence[int], steps: Sequence[str]) -> tuple[str, ...]:
    """Return an index with steps along some more axes of it."""
    others, folded = iter(index), iter(steps)
    return tuple(next(folded) if axis in axes else next(others) for axis in range(len(index) + len(steps)))


def _reduce(operation: str) -> Rule:
    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        (value,), kind = operands, str(out.dtype)
        axes = sorted(int(axis) % len(value.shape) for axis in params["axes"])
        target = block.array(kind, out.shape)
        with block.loops(out.shape) as index:
            total = block.variable(kind, _neutral(operation, kind))
            with block.loops(tuple(value.shape[axis] for axis in axes)) as steps:
                more = value.read(_inserted(index, axes, steps))
                block.put(f"{total} = {apply(operation, kind, kind, total, more)};")
            block.put(f"{target.read(index)} = {total};")
        return target

    return rule


def _argument_of(better: str, not_better: str, worst: int) -> Rule:
    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        (value,), kind, axes = operands, str(out.dtype), list(map(int, params["axes"]))
        target = block.array(kind, out.shape)
        with block.loops(out.shape) as index:
            best = block.variable(value.kind, number(_extreme(value.kind, worst), value.kind))
            where = block.variable(kind, "0")
            with block.loops((value.shape[axes[0]],)) as steps:
                here = block.let(value.kind, value.read(_inserted(index, axes, steps)))
                nan_first = f"!({here} {not_better} {best}) && {best} == {best}"  # as in JAX: the first NaN counts most
                with block.braces(f"if ({nan_first if value.kind == 'float32' else f'{here} {better} {best}'})"):
                    block.put(f"{best} = {here};")
                    block.put(f"{where} = {converted(steps[0], 'int32', kind)};")
            block.put(f"{target.read(index)} = {where};")
        return target

    return rule


def _cumulative(operation: str) -> Rule:
    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        (value,), kind, axis = operands, str(out.dtype), int(params["axis"])
        target, length = block.array(kind, out.shape), out.shape[axis]
        with block.loops((*out.shape[:axis], *out.shape[axis + 1 :])) as index:
            total = block.variable(kind, _neutral(operation, kind))
            with block.loops((length,)) as (step,):
                at = _inserted(index, [axis], [f"({length - 1} - {step})" if params["reverse"] else step])
                block.put(f"{total} = {apply(operation, kind, kind, total, value.read(at))};")
                block.put(f"{target.read(at)} = {total};")
        return target

    return rule


def _dot(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    """Sum in the outer loop: the inner one runs along the result, and is left out where the factor that is the same for
    all of it is 0, as many outputs of rectifiers are.
    """
    factors, (sums, batches) = list(map(block.stored, operands)), params["dimension_numbers"]
    kind = str(out.dtype)
    target = block.filled(scalar(kind, "0", out.shape))
    own = [
        [axis for axis in range(len(one.shape)) if axis not in (*summed, *batch)]
        for one, summed, batch in zip(factors, sums, batches, strict=True)
    ]
    shapes = [tuple(one.shape[axis] for axis in axes) for one, axes in zip(factors, own, strict=True)]
    slow, fast = (1, 0) if prod(shapes[1]) == 1 else (0, 1)

    def element(side: int, common: Index, rest: Index) -> str:
        place = dict(zip([*batches[side], *sums[side], *own[side]], [*common, *rest], strict=True))
        return factors[side].read(tuple(place[axis] for axis in range(len(place))))

    known = tuple(factors[0].shape[axis] for axis in (*batches[0], *sums[0]))
    with block.loops(known) as common, block.loops(shapes[slow]) as outer:
        fixed = block.let(kind, element(slow, common, outer))
        is_long = prod(shapes[fast]) >= _WORTH_A_TEST
        with block.braces(f"if ({fixed} != 0)") if is_long else nullcontext(), block.loops(shapes[fast]) as inner:
            rows = (*outer, *inner) if slow == 0 else (*inner, *outer)
            place = target.read((*common[: len(batches[0])], *rows))
            product = apply("mul", kind, kind, fixed, element(fast, common, inner))
            block.put(f"{place} = {apply('add', kind, kind, place, product)};")
    return target


_OPERATIONS = {"sum": "add", "prod": "mul", "max": "max", "min": "min", "and": "and", "or": "or", "xor": "xor"}

FOLDS: dict[str, Rule] = {
    **{f"reduce_{word}": _reduce(operation) for word, operation in _OPERATIONS.items()},
    **{f"cum{word}": _cumulative(_OPERATIONS[word]) for word in ("sum", "prod", "max", "min")},
    "argmax": _argument_of(">", "<=", -1),
    "argmin": _argument_of("<", ">=", 1),
    "concatenate": lambda block, operands, params, out: _joined(block, operands, int(params["dimension"]), out),
    "stack": _stack,
}
"""Primitives that read each element of an operand once, by name."""

OTHERS: dict[str, Rule] = {"pad": _pad, "dot_general": _dot}
"""Primitives that read some elements more than once, by name."""


Run = Callable[[Block, Any, Sequence[Any], Sequence[Value]], list[Value]]
"""From a block to write in, a function, its constants and its arguments to its results."""


def scan(run: Run, block: Block, given: list[Value], params: Any) -> list[Value]:
    """Return the carry after the last step and what every step put out."""
    consts, carried = params["num_consts"], params["num_carry"]
    jaxpr, length = params["jaxpr"], params["length"]
    fixed, rows = given[:consts], given[consts + carried :]
    carry = list(map(block.filled, given[consts : consts + carried]))
    outs = [out.aval for out in jaxpr.jaxpr.outvars[carried:]]
    ys = [block.array(str(out.dtype), (length, *out.shape)) for out in outs]
    with block.loops((length,)) as (step,):
        here = f"({length - 1} - {step})" if params["reverse"] else step
        now = [*fixed, *carry, *(row_along(one, here) for one in rows)]
        results = run(block, jaxpr.jaxpr, jaxpr.consts, now)
        for value, row in zip(results[carried:], ys, strict=True):
            block.copy(value, row_along(row, here))
        _assign(block, results[:carried], carry)
    return [*carry, *ys]


def while_loop(run: Run, block: Block, given: list[Value], params: Any) -> list[Value]:
    """Return the carry when the condition no longer holds."""
    asked, done = params["cond_nconsts"], params["body_nconsts"]
    condition, body = params["cond_jaxpr"], params["body_jaxpr"]
    carry = list(map(block.filled, given[asked + done :]))
    with block.braces("for (;;)"):
        (holds,) = run(block, condition.jaxpr, condition.consts, [*given[:asked], *carry])
        block.put(f"if (!{holds.first}) break;")
        _assign(block, run(block, body.jaxpr, body.consts, [*given[asked : asked + done], *carry]), carry)
    return carry


def cond(run: Run, block: Block, given: list[Value], params: Any) -> list[Value]:
    """Return the results of the branch that is asked for; of the last one for a number beyond."""
    branches = params["branches"]
    made = [block.array(str(out.aval.dtype), out.aval.shape) for out in branches[0].jaxpr.outvars]
    for place, branch in enumerate(branches):
        words = ["else"] if place else []
        if place < len(branches) - 1:
            words.append(f"if ({is_at_most(given[0].first, given[0].kind, place)})")
        with block.braces(" ".join(words)):
            for value, target in zip(run(block, branch.jaxpr, branch.consts, given[1:]), made, strict=True):
                block.copy(value, target)
    return made


def _assign(block: Block, values: Sequence[Value], variables: Sequence[Value]) -> None:
    """Assign all at once: what may read another variable is copied before that one changes."""
    changing = {"", *map(buffer_of, variables)}
    ready = [
        value if value is variable or buffer_of(value) not in changing else block.copied(value)
        for value, variable in zip(values, variables, strict=True)
    ]
    for value, variable in zip(ready, variables, strict=True):
        if value is not variable:
            block.copy(value, variable)


def _split(run: Run, block: Block, given: list[Value], params: Any) -> list[Value]:
    (value,), pieces, start = given, list[Value](), 0
    for size in map(int, params["sizes"]):
        shape = tuple(size if axis == params["axis"] else n for axis, n in enumerate(value.shape))
        pieces.append(part(value, shape, [str(start if axis == params["axis"] else 0) for axis in range(len(shape))]))
        start += size
    return pieces


CONTROL: dict[str, Callable[[Run, Block, list[Value], Any], list[Value]]] = {
    **{"scan": scan, "while": while_loop, "cond": cond, "split": _split},
    "optimization_barrier": lambda run, block, given, params: given,
}
"""Rules of the primitives with several results, by name."""
