"""Primitives of JAX that are loops over arrays: joining, folding along axes, matrix products."""

from collections.abc import Sequence
from contextlib import nullcontext
from math import prod
from typing import Any

import numpy as np

from jaxpr2c.block import Block, Index, Value, scalar, shift
from jaxpr2c.elementwise import Params, Rule
from jaxpr2c.indexing import part
from jaxpr2c.scalars import apply_operation, convert, number

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

MULTIPLE_READS: dict[str, Rule] = {"pad": _pad, "dot_general": _dot}
"""Primitives that read some elements more than once, by name."""
