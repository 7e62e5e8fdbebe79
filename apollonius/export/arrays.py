"""Primitives of JAX that are loops or branches: joining, folding along axes, products of matrices,
control flow.
"""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from math import prod
from typing import Any

import numpy as np

from apollonius.export.block import Block, Index, Value, buffer_of, row_along, scalar, shift
from apollonius.export.elementwise import Params, Rule, is_at_most
from apollonius.export.indexing import part
from apollonius.export.scalars import apply_operation, convert, number

_WORTH_A_TEST = 8
"""Length of the inner loop of a product from which on a factor of 0 is looked for."""


def _joined(block: Block, pieces: Sequence[Value], axis: int, out: Any) -> Value:
    target = block.array(str(out.dtype), out.shape)
    start = 0
    for piece in pieces:
        starts = [str(start if dimension == axis else 0) for dimension in range(len(out.shape))]
        block.copy(piece, part(target, piece.shape, starts))
        start += piece.shape[axis]
    return target


def _concatenate(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    return _joined(block, operands, int(params["dimension"]), out)


def _stack(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    axis = int(params["axis"]) % len(out.shape)
    shape = tuple(1 if dimension == axis else length for dimension, length in enumerate(out.shape))
    axes = [dimension for dimension in range(len(shape)) if dimension != axis]
    return _joined(block, [shift(operand, shape, axes) for operand in operands], axis, out)


def _pad(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value, filler = operands
    low = [int(config[0]) for config in params["padding_config"]]
    high = [int(config[1]) for config in params["padding_config"]]
    gaps = [int(config[2]) for config in params["padding_config"]]
    if min(*low, *high) < 0:
        raise NotImplementedError("by less than nothing")
    target = block.new_array(shift(filler, out.shape, []))
    starts = [str(length) for length in low]
    steps = [gap + 1 for gap in gaps]
    block.copy(value, shift(target, value.shape, range(len(low)), starts, steps))
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
    return number(
        -1 if operation == "and" and kind != "bool" else operation in ("mul", "and"), kind
    )


def _inserted(index: Sequence[str], axes: Sequence[int], steps: Sequence[str]) -> tuple[str, ...]:
    """Insert steps along further axes into an index."""
    outer_steps = iter(index)
    inner_steps = iter(steps)
    num_axes = len(index) + len(steps)
    return tuple(next(inner_steps if axis in axes else outer_steps) for axis in range(num_axes))


def _reduce(operation: str) -> Rule:
    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        (value,) = operands
        kind = str(out.dtype)
        axes = sorted(int(axis) % len(value.shape) for axis in params["axes"])
        target = block.array(kind, out.shape)
        with block.loops(out.shape) as index:
            total = block.variable(kind, _neutral(operation, kind))
            with block.loops(tuple(value.shape[axis] for axis in axes)) as steps:
                more = value.read(_inserted(index, axes, steps))
                block.put(f"{total} = {apply_operation(operation, kind, kind, total, more)};")
            block.put(f"{target.read(index)} = {total};")
        return target

    return rule


def _argument_of(better: str, not_better: str, worst: int) -> Rule:
    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        (value,) = operands
        kind = str(out.dtype)
        axes = list(map(int, params["axes"]))
        target = block.array(kind, out.shape)
        with block.loops(out.shape) as index:
            best = block.variable(value.kind, number(_extreme(value.kind, worst), value.kind))
            best_index = block.variable(kind, "0")
            with block.loops((value.shape[axes[0]],)) as steps:
                element = block.let(value.kind, value.read(_inserted(index, axes, steps)))
                test = f"{element} {better} {best}"
                if value.kind == "float32":  # as in JAX, the first NaN is the result
                    test = f"!({element} {not_better} {best}) && {best} == {best}"
                with block.braces(f"if ({test})"):
                    block.put(f"{best} = {element};")
                    block.put(f"{best_index} = {convert(steps[0], 'int32', kind)};")
            block.put(f"{target.read(index)} = {best_index};")
        return target

    return rule


def _cumulative(operation: str) -> Rule:
    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        (value,) = operands
        kind = str(out.dtype)
        axis = int(params["axis"])
        target = block.array(kind, out.shape)
        length = out.shape[axis]
        with block.loops((*out.shape[:axis], *out.shape[axis + 1 :])) as index:
            total = block.variable(kind, _neutral(operation, kind))
            with block.loops((length,)) as (step,):
                position = f"({length - 1} - {step})" if params["reverse"] else step
                element_index = _inserted(index, [axis], [position])
                block.put(
                    f"{total} = "
                    f"{apply_operation(operation, kind, kind, total, value.read(element_index))};"
                )
                block.put(f"{target.read(element_index)} = {total};")
        return target

    return rule


def _dot(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    """Write a product of arrays whose sum is the outer loop and whose inner loop runs along the
    result.

    The inner loop is skipped where its fixed factor is 0, as many outputs of rectifiers are.
    """
    factors = list(map(block.as_stored, operands))
    sums, batches = params["dimension_numbers"]
    kind = str(out.dtype)
    target = block.new_array(scalar(kind, "0", out.shape))
    own = [
        [axis for axis in range(len(factor.shape)) if axis not in (*summed, *batch)]
        for factor, summed, batch in zip(factors, sums, batches, strict=True)
    ]
    shapes = [
        tuple(factor.shape[axis] for axis in axes)
        for factor, axes in zip(factors, own, strict=True)
    ]
    slow, fast = (1, 0) if prod(shapes[1]) == 1 else (0, 1)

    def element(side: int, common: Index, free: Index) -> str:
        axes = [*batches[side], *sums[side], *own[side]]
        location = dict(zip(axes, [*common, *free], strict=True))
        return factors[side].read(tuple(location[axis] for axis in range(len(location))))

    contracted = tuple(factors[0].shape[axis] for axis in (*batches[0], *sums[0]))
    with block.loops(contracted) as common, block.loops(shapes[slow]) as outer:
        fixed = block.let(kind, element(slow, common, outer))
        is_long = prod(shapes[fast]) >= _WORTH_A_TEST
        skip_zero = block.braces(f"if ({fixed} != 0)") if is_long else nullcontext()
        with skip_zero, block.loops(shapes[fast]) as inner:
            rows = (*outer, *inner) if slow == 0 else (*inner, *outer)
            location = target.read((*common[: len(batches[0])], *rows))
            product = apply_operation("mul", kind, kind, fixed, element(fast, common, inner))
            block.put(f"{location} = {apply_operation('add', kind, kind, location, product)};")
    return target


_OPERATIONS = {"sum": "add", "prod": "mul"} | {
    name: name for name in ("max", "min", "and", "or", "xor")
}

FOLDS: dict[str, Rule] = {
    **{f"reduce_{word}": _reduce(operation) for word, operation in _OPERATIONS.items()},
    **{f"cum{word}": _cumulative(_OPERATIONS[word]) for word in ("sum", "prod", "max", "min")},
    "argmax": _argument_of(">", "<=", -1),
    "argmin": _argument_of("<", ">=", 1),
    "concatenate": _concatenate,
    "stack": _stack,
}
"""Primitives that read each element of an operand once, by name."""

OTHERS: dict[str, Rule] = {"pad": _pad, "dot_general": _dot}
"""Primitives that read some elements more than once, by name."""


ControlRule = Callable[[Block, Any, Sequence[Any], Sequence[Value]], list[Value]]
"""From a block to write in, a function, its constants and its arguments to its results."""


def scan(run: ControlRule, block: Block, operands: list[Value], params: Any) -> list[Value]:
    """Write a scan; return the carry after the last step and the outputs of all steps.

    Args:
        run: Writes the equations of a function.
        block: Block to write in.
        operands: Constants, first carry and rows.
        params: Parameters of JAX's primitive.
    """
    consts = params["num_consts"]
    num_carry = params["num_carry"]
    jaxpr = params["jaxpr"]
    length = params["length"]
    fixed = operands[:consts]
    rows = operands[consts + num_carry :]
    carry = list(map(block.new_array, operands[consts : consts + num_carry]))
    outs = [out.aval for out in jaxpr.jaxpr.outvars[num_carry:]]
    ys = [block.array(str(out.dtype), (length, *out.shape)) for out in outs]
    with block.loops((length,)) as (step,):
        step_index = f"({length - 1} - {step})" if params["reverse"] else step
        inputs = [*fixed, *carry, *(row_along(row, step_index) for row in rows)]
        results = run(block, jaxpr.jaxpr, jaxpr.consts, inputs)
        for value, row in zip(results[num_carry:], ys, strict=True):
            block.copy(value, row_along(row, step_index))
        _assign(block, results[:num_carry], carry)
    return [*carry, *ys]


def while_loop(run: ControlRule, block: Block, operands: list[Value], params: Any) -> list[Value]:
    """Write a loop; return the carry when the condition no longer holds.

    Args:
        run: Writes the equations of a function.
        block: Block to write in.
        operands: Constants of the condition, constants of the body, and the first carry.
        params: Parameters of JAX's primitive.
    """
    body_start = params["cond_nconsts"]
    carry_start = body_start + params["body_nconsts"]
    condition = params["cond_jaxpr"]
    body = params["body_jaxpr"]
    carry = list(map(block.new_array, operands[carry_start:]))
    with block.braces("for (;;)"):
        condition_inputs = [*operands[:body_start], *carry]
        (holds,) = run(block, condition.jaxpr, condition.consts, condition_inputs)
        block.put(f"if (!{holds.first}) break;")
        body_inputs = [*operands[body_start:carry_start], *carry]
        _assign(block, run(block, body.jaxpr, body.consts, body_inputs), carry)
    return carry


def cond(run: ControlRule, block: Block, operands: list[Value], params: Any) -> list[Value]:
    """Write a choice of branches; return the results of the chosen one.

    Args:
        run: Writes the equations of a function.
        block: Block to write in.
        operands: Number of the branch, of the last one if it is larger, and the inputs of all.
        params: Parameters of JAX's primitive.
    """
    branches = params["branches"]
    results = [
        block.array(str(out.aval.dtype), out.aval.shape) for out in branches[0].jaxpr.outvars
    ]
    for place, branch in enumerate(branches):
        words = ["else"] if place else []
        if place < len(branches) - 1:
            choice = operands[0]
            words.append(f"if ({is_at_most(choice.first, choice.kind, place)})")
        with block.braces(" ".join(words)):
            values = run(block, branch.jaxpr, branch.consts, operands[1:])
            for value, target in zip(values, results, strict=True):
                block.copy(value, target)
    return results


def _assign(block: Block, values: Sequence[Value], variables: Sequence[Value]) -> None:
    """Assign values to variables at once: a value that may read another variable is copied
    first.
    """
    changing = {"", *map(buffer_of, variables)}
    ready = [
        value if value is variable or buffer_of(value) not in changing else block.copy_of(value)
        for value, variable in zip(values, variables, strict=True)
    ]
    for value, variable in zip(ready, variables, strict=True):
        if value is not variable:
            block.copy(value, variable)


def _split(run: ControlRule, block: Block, operands: list[Value], params: Any) -> list[Value]:
    (value,) = operands
    axis = params["axis"]
    pieces = list[Value]()
    start = 0
    for size in map(int, params["sizes"]):
        shape = tuple(size if own == axis else length for own, length in enumerate(value.shape))
        starts = [str(start if own == axis else 0) for own in range(len(shape))]
        pieces.append(part(value, shape, starts))
        start += size
    return pieces


CONTROL: dict[str, Callable[[ControlRule, Block, list[Value], Any], list[Value]]] = {
    **{"scan": scan, "while": while_loop, "cond": cond, "split": _split},
    "optimization_barrier": lambda run, block, operands, params: operands,
}
"""Rules of the primitives with several results, by name."""
