"""Primitives of JAX that read or write where an index says, which is kept within bounds."""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from apollonius.export.elementwise import Params, Rule, converted
from apollonius.export.program import Apply, Expression, Number, plus
from apollonius.export.values import Block, Value, part


def _within(block: Block, start: Expression, most: int) -> Expression:
    """A start index between 0 and the last one that there is room for."""
    if isinstance(start, Number) or most <= 0:
        return Number(min(max(int(start.value), 0), most) if isinstance(start, Number) and most > 0 else 0)
    above = Apply("max", "int32", (converted(start, "int32"), Number(0)))
    return block.let(Apply("min", "int32", (above, Number(most))))


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
    there: list[Expression] = [Number(0) if axis in gone else next(offsets) for axis in range(len(value.shape))]
    for axis, place in zip(numbers.operand_batching_dims, numbers.start_indices_batching_dims, strict=True):
        there[axis] = batch[place]
    known: Expression = Number(True, "bool")
    for component, axis in enumerate(numbers.start_index_map):
        most = value.shape[axis] - sizes[axis]
        start = inner.let(converted(indices.read((*batch, Number(component))), "int32"))
        for bound in (Apply("ge", "bool", (start, Number(0))), Apply("le", "bool", (start, Number(most)))):
            known = bound if isinstance(known, Number) else Apply("and", "bool", (known, bound))
        there[axis] = plus(there[axis], _within(inner, start, most))
    element = value.read(tuple(there))
    if params["mode"] == jax.lax.GatherScatterMode.FILL_OR_DROP:
        filler = np.asarray(params["fill_value"]).astype(value.kind).item()
        element = Apply("select", value.kind, (known, element, Number(filler, value.kind)))
    inner.store(target, index, element)
    block.close(index, out.shape, inner)
    return target


INDEXED: dict[str, Rule] = {
    "dynamic_slice": _dynamic_slice,
    "dynamic_update_slice": _dynamic_update_slice,
    "gather": _gather,
}
"""By the name of the primitive."""
