"""Primitives of JAX that read or write parts of an array by an index: slices, gathers, scatters."""

from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any

import jax
import numpy as np

from jaxpr2c.block import Block, Index, Value, shift
from jaxpr2c.elementwise import Params, Rule
from jaxpr2c.scalars import apply_operation, convert, number, plus


def part(value: Value, shape: tuple[int, ...], starts: Sequence[str]) -> Value:
    """Return the part of an array that begins at some index."""
    return shift(value, shape, range(len(shape)), starts)


def _whole(block: Block, text: str, kind: str) -> str:
    """Convert an index to int32; one beyond the range becomes the largest."""
    if kind == "uint32":
        text = apply_operation(
            "min", kind, kind, block.let(kind, text), number(np.iinfo("int32").max, kind)
        )
    return block.let("int32", convert(text, kind, "int32"))


def _within(block: Block, text: str, kind: str, most: int) -> str:
    """Clip a start index to be between 0 and `most`."""
    if most <= 0:
        return "0"
    if text.isdigit():
        return str(min(int(text), most))
    start = _whole(block, text, kind)
    return block.let("int32", f"{start} < 0 ? 0 : {start} > {most} ? {most} : {start}")


def _starts(
    block: Block, starts: Sequence[Value], shape: Sequence[int], sizes: Sequence[int]
) -> list[str]:
    sizes_by_axis = zip(starts, shape, sizes, strict=True)
    return [
        _within(block, start.first, start.kind, length - size)
        for start, length, size in sizes_by_axis
    ]


def _dynamic_slice(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value, *starts = operands
    return part(block.as_stored(value), out.shape, _starts(block, starts, value.shape, out.shape))


def _dynamic_update_slice(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value, update, *starts = operands
    target = block.new_array(value)
    block.copy(
        update, part(target, update.shape, _starts(block, starts, value.shape, update.shape))
    )
    return target


def _indexed(
    block: Block,
    indices: Value,
    index: Index,
    axes: tuple[Sequence[Any], ...],
    lengths: Sequence[tuple[int, int]],
) -> tuple[tuple[str, ...], str]:
    """Locate an element of a gather or a scatter in the array; return its index and a test, in C,
    of its bounds.

    Args:
        block: Block to write in.
        indices: The indices of the gather or scatter.
        index: Index of the element in the result or the updates.
        axes: In the terms of the dimension numbers: the window's axes in `index`; the array's axes
            that the window lacks; the array's axes along the last axis of the indices; the batch
            axes of the array; the batch axes of the indices.
        lengths: Length of the array and of the window along each axis of the array.
    """
    window, missing_axes, along, batch_axes, index_batch_axes = axes
    batch = [step for axis, step in enumerate(index) if axis not in window]
    offsets = iter([index[axis] for axis in window])
    without_window = {*missing_axes, *batch_axes}
    location = ["0" if axis in without_window else next(offsets) for axis in range(len(lengths))]
    for axis, index_axis in zip(batch_axes, index_batch_axes, strict=True):
        location[axis] = batch[index_axis]
    bounds = list[str]()
    for component, axis in enumerate(along):
        most = lengths[axis][0] - lengths[axis][1]
        start = _whole(block, indices.read((*batch, str(component))), indices.kind)
        bounds.append(f"{start} >= 0 && {start} <= {most}")
        location[axis] = plus(location[axis], _within(block, start, "int32", most))
    return tuple(location), " && ".join(bounds)


def _gather(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value, indices = map(block.as_stored, operands)
    numbers = params["dimension_numbers"]
    axes = numbers.offset_dims, numbers.collapsed_slice_dims, numbers.start_index_map
    axes += numbers.operand_batching_dims, numbers.start_indices_batching_dims
    target = block.array(str(out.dtype), out.shape)
    with block.loops(out.shape) as index:
        lengths = [*zip(value.shape, params["slice_sizes"], strict=True)]
        place, is_inside = _indexed(block, indices, index, axes, lengths)
        element = value.read(place)
        if params["mode"] == jax.lax.GatherScatterMode.FILL_OR_DROP:
            filler = number(np.asarray(params["fill_value"]).astype(value.kind).item(), value.kind)
            element = f"({is_inside} ? {element} : {filler})"
        block.put(f"{target.read(index)} = {element};")
    return target


def _scatter(operation: str | None) -> Rule:
    """Return the rule of a scatter, where updates replace elements, or an operation combines
    both.
    """

    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        value = operands[0]
        indices, updates = map(block.as_stored, operands[1:])
        numbers = params["dimension_numbers"]
        window = numbers.update_window_dims
        inserted = {*numbers.inserted_window_dims, *numbers.operand_batching_dims}
        axes = window, numbers.inserted_window_dims, numbers.scatter_dims_to_operand_dims
        axes += numbers.operand_batching_dims, numbers.scatter_indices_batching_dims
        sizes = iter([updates.shape[axis] for axis in window])
        window_shape = [1 if axis in inserted else next(sizes) for axis in range(len(value.shape))]
        lengths = [*zip(value.shape, window_shape, strict=True)]
        target = block.new_array(value)
        drops = params["mode"] == jax.lax.GatherScatterMode.FILL_OR_DROP
        with block.loops(updates.shape) as index:
            element_index, is_inside = _indexed(block, indices, index, axes, lengths)
            place = target.read(element_index)
            update = updates.read(index)
            result = (
                apply_operation(operation, value.kind, value.kind, place, update)
                if operation
                else update
            )
            with block.braces(f"if ({is_inside})") if drops else nullcontext():
                block.put(f"{place} = {result};")
        return target

    return rule


INDEXED: dict[str, Rule] = {
    "dynamic_slice": _dynamic_slice,
    "dynamic_update_slice": _dynamic_update_slice,
    "gather": _gather,
    "scatter": _scatter(None),
    **{f"scatter-{word}": _scatter(word) for word in ("add", "mul", "max", "min")},
}
"""Primitives that read some elements more than once, or not at all, by name."""
