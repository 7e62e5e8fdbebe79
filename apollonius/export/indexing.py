"""Primitives of JAX that read or write parts of an array by an index: slices, gathers, scatters."""

from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any

import jax
import numpy as np

from apollonius.export.block import Block, Index, Value, moved
from apollonius.export.elementwise import Params, Rule
from apollonius.export.scalars import apply, converted, number, plus


def part(value: Value, shape: tuple[int, ...], starts: Sequence[str]) -> Value:
    """Return the part of an array that begins at some index."""
    return moved(value, shape, range(len(shape)), starts)


def _whole(block: Block, text: str, kind: str) -> str:
    """Return an index as an int32: one beyond its range as the largest."""
    if kind == "uint32":
        text = apply("min", kind, kind, block.let(kind, text), number(np.iinfo("int32").max, kind))
    return block.let("int32", converted(text, kind, "int32"))


def _within(block: Block, text: str, kind: str, most: int) -> str:
    """Return a start index between 0 and the last one with room behind it."""
    if most <= 0:
        return "0"
    if text.isdigit():
        return str(min(int(text), most))
    start = _whole(block, text, kind)
    return block.let("int32", f"{start} < 0 ? 0 : {start} > {most} ? {most} : {start}")


def _starts(block: Block, starts: Sequence[Value], shape: Sequence[int], sizes: Sequence[int]) -> list[str]:
    three = zip(starts, shape, sizes, strict=True)
    return [_within(block, start.first, start.kind, length - size) for start, length, size in three]


def _dynamic_slice(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value, *starts = operands
    return part(block.stored(value), out.shape, _starts(block, starts, value.shape, out.shape))


def _dynamic_update_slice(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value, update, *starts = operands
    target = block.filled(value)
    block.copy(update, part(target, update.shape, _starts(block, starts, value.shape, update.shape)))
    return target


def _indexed(
    block: Block, indices: Value, index: Index, axes: tuple[Sequence[Any], ...], lengths: Sequence[tuple[int, int]]
) -> tuple[tuple[str, ...], str]:
    """Return the place of an array that an element of a gather or a scatter is of, and a test of whether it is there.

    The axes are, as the dimension numbers name them, those of the window in the element's `index`, those of the array
    that the window does not have, those that indices are along, and those of the array and of the indices that are
    batched; the lengths those of each axis of the array and of the window.
    """
    window, gone, along, batched, batches = axes
    batch = [step for axis, step in enumerate(index) if axis not in window]
    offsets = iter([index[axis] for axis in window])
    there = ["0" if axis in (*gone, *batched) else next(offsets) for axis in range(len(lengths))]
    for axis, place in zip(batched, batches, strict=True):
        there[axis] = batch[place]
    known = list[str]()
    for component, axis in enumerate(along):
        most = lengths[axis][0] - lengths[axis][1]
        start = _whole(block, indices.read((*batch, str(component))), indices.kind)
        known.append(f"{start} >= 0 && {start} <= {most}")
        there[axis] = plus(there[axis], _within(block, start, "int32", most))
    return tuple(there), " && ".join(known)


def _gather(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value, indices = map(block.stored, operands)
    numbers = params["dimension_numbers"]
    axes = numbers.offset_dims, numbers.collapsed_slice_dims, numbers.start_index_map
    axes += numbers.operand_batching_dims, numbers.start_indices_batching_dims
    target = block.array(str(out.dtype), out.shape)
    with block.loops(out.shape) as index:
        lengths = [*zip(value.shape, params["slice_sizes"], strict=True)]
        there, known = _indexed(block, indices, index, axes, lengths)
        element = value.read(there)
        if params["mode"] == jax.lax.GatherScatterMode.FILL_OR_DROP:
            filler = number(np.asarray(params["fill_value"]).astype(value.kind).item(), value.kind)
            element = f"({known} ? {element} : {filler})"
        block.put(f"{target.read(index)} = {element};")
    return target


def _scatter(operation: str | None) -> Rule:
    """Return the rule of a scatter: updates replace elements, or an operation takes both."""

    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        value, indices, updates = operands[0], *map(block.stored, operands[1:])
        numbers = params["dimension_numbers"]
        window, gone = numbers.update_window_dims, (*numbers.inserted_window_dims, *numbers.operand_batching_dims)
        axes = window, numbers.inserted_window_dims, numbers.scatter_dims_to_operand_dims
        axes += numbers.operand_batching_dims, numbers.scatter_indices_batching_dims
        sizes = iter([updates.shape[axis] for axis in window])
        lengths = [(length, 1 if axis in gone else next(sizes)) for axis, length in enumerate(value.shape)]
        target = block.filled(value)
        drops = params["mode"] == jax.lax.GatherScatterMode.FILL_OR_DROP
        with block.loops(updates.shape) as index:
            there, known = _indexed(block, indices, index, axes, lengths)
            place, new = target.read(there), updates.read(index)
            made = apply(operation, value.kind, value.kind, place, new) if operation else new
            with block.braces(f"if ({known})") if drops else nullcontext():
                block.put(f"{place} = {made};")
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
