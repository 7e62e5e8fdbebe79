"""What each primitive of JAX computes, as loops over flat arrays. Control flow is in `apollonius.export.translate`."""

from collections.abc import Callable, Mapping, Sequence
from math import prod
from typing import Any

import jax
import numpy as np

from apollonius.export.program import Apply, Branch, Expression, Load, Loop, Name, Number, Statement, Store, apply, plus, times
from apollonius.export.values import Block, Index, Shape, Value, moved, number, placed, reshaped, scalar

Rule = Callable[[Block, list[Value], Mapping[str, Any], Any], Value]
"""From the block to write in, the operands, the parameters and the type of the result to that result."""

BINARY = ("add", "sub", "mul", "div", "rem", "max", "min", "pow", "atan2", "and", "or", "xor")
COMPARISONS = ("eq", "ne", "lt", "le", "gt", "ge")
SHIFTS = ("shift_left", "shift_right_logical", "shift_right_arithmetic")
UNARY = (
    "neg abs sign floor ceil sqrt rsqrt exp exp2 expm1 log log1p sin cos tan asin acos atan sinh cosh tanh logistic "
    "square not is_finite cbrt"
).split()
ELEMENTWISE = frozenset(
    [*BINARY, *COMPARISONS, *SHIFTS, *UNARY, "select_n", "clamp", "convert_element_type", "integer_pow", "round"]
)
"""Primitives whose results can be computed as they are read."""
VIEWS = frozenset(["broadcast_in_dim", "squeeze", "expand_dims", "transpose", "slice", "rev", "stop_gradient", "copy",
                   "copy_p", "reduce_precision", "iota", "reshape"])
"""Primitives that move nothing: their results are the operand seen otherwise."""


def _along(value: Value, index: Index) -> Expression:
    """An operand's element: axes of length 1 are broadcast, and so is a lone number."""
    if not value.shape:
        return value.read(())
    return value.read(tuple(Number(0) if length == 1 else step for step, length in zip(index, value.shape, strict=True)))


def _elementwise(operation: str) -> Rule:
    def rule(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
        kind = str(out.dtype)

        def read(index: Index) -> Expression:
            return apply(operation, kind, *(_along(one, index) for one in operands))

        return Value(kind, out.shape, read)

    return rule


def _convert(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    (value,), kind = operands, str(out.dtype)
    if value.kind == kind:
        return value

    def read(index: Index) -> Expression:
        here = value.read(index)
        if isinstance(here, Number):
            return Number(np.dtype(kind).type(here.value).item(), kind)
        return Apply("convert", kind, (here,))

    return Value(kind, out.shape, read)


def _power(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    exponent = number(params["y"], "int32")
    return _elementwise("integer_pow")(block, [*operands, exponent], params, out)


def _round(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    to_even = params["rounding_method"] == jax.lax.RoundingMethod.TO_NEAREST_EVEN
    return _elementwise("round_even" if to_even else "round_away")(block, operands, params, out)


def _broadcast(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    (value,) = operands
    axes = [None if length == 1 else axis for axis, length in zip(params["broadcast_dimensions"], value.shape, strict=True)]
    return moved(value, out.shape, axes, [Number(0)] * len(axes), [1] * len(axes))


def _squeeze(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    (value,) = operands
    gone = {axis % len(value.shape) for axis in params["dimensions"]}
    kept = iter(range(len(out.shape)))
    axes = [None if axis in gone else next(kept) for axis in range(len(value.shape))]
    return moved(value, out.shape, axes, [Number(0)] * len(axes), [1] * len(axes))


def _expand(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    new = {axis % len(out.shape) for axis in params["dimensions"]}
    axes = [axis for axis in range(len(out.shape)) if axis not in new]
    return moved(operands[0], out.shape, axes, [Number(0)] * len(axes), [1] * len(axes))


def _transpose(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    order = params["permutation"]
    axes = [order.index(axis) for axis in range(len(order))]
    return moved(operands[0], out.shape, axes, [Number(0)] * len(axes), [1] * len(axes))


def _slice(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    starts = [Number(start) for start in params["start_indices"]]
    return moved(operands[0], out.shape, range(len(starts)), starts, params["strides"] or [1] * len(starts))


def _reverse(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    turned = [axis in params["dimensions"] for axis in range(len(out.shape))]
    starts = [Number(length - 1 if turn else 0) for length, turn in zip(out.shape, turned, strict=True)]
    return moved(operands[0], out.shape, range(len(turned)), starts, [-1 if turn else 1 for turn in turned])


def _reshape(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    (value,) = operands
    return reshaped(value if value.size == 1 else block.in_one_piece(value), out.shape)


def _same(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    return operands[0]


def _iota(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    kind, axis = str(out.dtype), params["dimension"]

    def read(index: Index) -> Expression:
        here = index[axis]
        if isinstance(here, Number):
            return Number(np.dtype(kind).type(here.value).item(), kind)
        return here if kind == "int32" else Apply("convert", kind, (here,))

    return Value(kind, out.shape, read, free=True)


def _select(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    which, *cases = operands

    def read(index: Index) -> Expression:
        chosen, asked = _along(cases[-1], index), _along(which, index)
        for case in range(len(cases) - 2, -1, -1):
            is_it = (
                apply("not", "bool", asked)
                if which.kind == "bool"
                else apply("le", "bool", asked, Number(case, which.kind))
            )
            chosen = apply("select", str(out.dtype), is_it, _along(cases[case], index), chosen)
        return chosen

    return Value(str(out.dtype), out.shape, read)


def _clamp(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    low, value, high = operands
    above = _elementwise("max")(block, [value, low], params, out)
    return _elementwise("min")(block, [above, high], params, out)


def _joined(block: Block, pieces: Sequence[Value], axis: int, out: Any) -> Value:
    target, start = block.empty(str(out.dtype), out.shape), 0
    assert target.place is not None
    for piece in pieces:
        starts = [Number(start if here == axis else 0) for here in range(len(out.shape))]
        block.copy(piece, moved(target, piece.shape, range(len(starts)), starts, [1] * len(starts)))
        start += piece.shape[axis]
    return target


def _concatenate(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    return _joined(block, operands, params["dimension"], out)


def _stack(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    axis = params["axis"] % len(out.shape)
    shape = tuple(1 if here == axis else length for here, length in enumerate(out.shape))
    axes = [here for here in range(len(shape)) if here != axis]
    pieces = [moved(one, shape, axes, [Number(0)] * len(axes), [1] * len(axes)) for one in operands]
    return _joined(block, pieces, axis, out)


def _pad(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    value, filler = operands
    target = block.empty(str(out.dtype), out.shape)
    index, inner = block.loops(out.shape)
    assert target.place is not None
    inner.add(Store(target.place.buffer, target.place.at(index), filler.read(())))
    block.close(index, out.shape, inner)
    low, high, gaps = zip(*params["padding_config"], strict=True) if params["padding_config"] else ((), (), ())
    if min([*low, *high], default=0) < 0:
        raise NotImplementedError("pad by less than nothing")
    inside = moved(target, value.shape, range(len(low)), list(map(Number, low)), [gap + 1 for gap in gaps])
    block.copy(value, inside)
    return target


def _folded(
    block: Block, shape: Shape, axes: Sequence[int], cells: Sequence[tuple[str, Number]],
    fold: Callable[[Block, Index, list[Expression]], list[Expression]], out: Any,
) -> Value:
    """Cells that are updated along some axes of an operand, for each place along the others; the last one remains."""
    target = block.empty(cells[-1][0], out.shape)
    assert target.place is not None
    index, outer = block.loops(out.shape)
    held = [outer.allocate(kind, 1, cell=True) for kind, _ in cells]
    for cell, (_, first) in zip(held, cells, strict=True):
        outer.add(Store(cell, Number(0), first))
    along = tuple(shape[axis] for axis in axes)
    steps, inner = outer.loops(along)
    others, reduced = iter(index), iter(steps)
    whole = tuple(next(reduced) if axis in axes else next(others) for axis in range(len(shape)))
    now: list[Expression] = [Load(cell, Number(0)) for cell in held]
    for cell, value in zip(held, fold(inner, whole, now), strict=True):
        inner.add(Store(cell, Number(0), value))
    outer.close(steps, along, inner)
    outer.add(Store(target.place.buffer, target.place.at(index), Load(held[-1], Number(0))))
    block.close(index, out.shape, outer)
    return target


def _least(kind: str) -> float | int | bool:
    if kind == "bool":
        return False
    return -np.inf if kind.startswith("float") else int(np.iinfo(kind).min)


def _greatest(kind: str) -> float | int | bool:
    if kind == "bool":
        return True
    return np.inf if kind.startswith("float") else int(np.iinfo(kind).max)


FIRSTS: dict[str, Callable[[str], float | int | bool]] = {
    "add": lambda kind: 0, "mul": lambda kind: 1, "max": _least, "min": _greatest,
    "and": _greatest, "or": lambda kind: False, "xor": lambda kind: False,
}


def _reduce(operation: str) -> Rule:
    def rule(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
        (value,), kind = operands, str(out.dtype)
        first = Number(FIRSTS[operation](kind), kind)
        axes = sorted(axis % len(value.shape) for axis in params["axes"])

        def fold(inner: Block, index: Index, now: list[Expression]) -> list[Expression]:
            return [Apply(operation, kind, (now[0], value.read(index)))]

        return _folded(block, value.shape, axes, [(kind, first)], fold, out)

    return rule


def _arg(better: str) -> Rule:
    def rule(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
        (value,), kind, (axis,) = operands, str(out.dtype), params["axes"]
        worst = _least(value.kind) if better == "gt" else _greatest(value.kind)

        def fold(inner: Block, index: Index, now: list[Expression]) -> list[Expression]:
            best, where = now
            here = inner.let(value.read(index))
            is_it = inner.let(Apply(better, "bool", (here, best)))
            step = index[axis] if kind == "int32" else Apply("convert", kind, (index[axis],))
            # The place first: the cell of the best one is read by its condition, which has a name already.
            return [Apply("select", value.kind, (is_it, here, best)), Apply("select", kind, (is_it, step, where))]

        return _folded(block, value.shape, [axis], [(value.kind, Number(worst, value.kind)), (kind, Number(0, kind))], fold, out)

    return rule


def _cumulative(operation: str) -> Rule:
    def rule(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
        (value,), kind, axis = operands, str(out.dtype), params["axis"]
        target = block.empty(kind, out.shape)
        assert target.place is not None
        others = tuple(1 if here == axis else length for here, length in enumerate(out.shape))
        index, outer = block.loops(others)
        cell = outer.allocate(kind, 1, cell=True)
        outer.add(Store(cell, Number(0), Number(FIRSTS[operation](kind), kind)))
        (step,), inner = outer.loops((out.shape[axis],))
        length = out.shape[axis]
        here = plus(Number(length - 1), times(step, -1)) if params["reverse"] else step
        at = tuple(here if along == axis else other for along, other in enumerate(index))
        inner.add(Store(cell, Number(0), Apply(operation, kind, (Load(cell, Number(0)), value.read(at)))))
        inner.add(Store(target.place.buffer, target.place.at(at), Load(cell, Number(0))))
        outer.close((step,), (length,), inner)
        block.close(index, others, outer)
        return target

    return rule


def _dot(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    """A product of matrices, summed over the outer loop: the inner one runs along the result, and is left out where the
    factor that does not change in it is 0, as many outputs of rectifiers are.
    """
    left, right = (block.stored(one) for one in operands)
    (left_sum, right_sum), (left_batch, right_batch) = params["dimension_numbers"]
    kind, target = str(out.dtype), block.empty(str(out.dtype), out.shape)
    assert target.place is not None
    index, inner = block.loops(out.shape)
    inner.add(Store(target.place.buffer, target.place.at(index), Number(0, kind)))
    block.close(index, out.shape, inner)
    batch_shape = tuple(left.shape[axis] for axis in left_batch)
    sums = tuple(left.shape[axis] for axis in left_sum)
    left_free = [axis for axis in range(len(left.shape)) if axis not in (*left_sum, *left_batch)]
    right_free = [axis for axis in range(len(right.shape)) if axis not in (*right_sum, *right_batch)]
    outer_shape = batch_shape + sums
    outer_index, outer = block.loops(outer_shape)
    batch, summed = outer_index[: len(batch_shape)], outer_index[len(batch_shape) :]

    def element(value: Value, batch_axes: Sequence[int], sum_axes: Sequence[int], free: Sequence[int], at: Index) -> Expression:
        known = dict(zip([*batch_axes, *sum_axes, *free], [*batch, *summed, *at], strict=True))
        return value.read(tuple(known[axis] for axis in range(len(value.shape))))

    def both(inner: Block, left_at: Index, right_at: Index, fixed: dict[int, Expression]) -> None:
        here = (*batch, *left_at, *right_at)
        factors = (
            fixed.get(0) or element(left, left_batch, left_sum, left_free, left_at),
            fixed.get(1) or element(right, right_batch, right_sum, right_free, right_at),
        )
        place = target.place.at(here)
        total = Apply("add", kind, (Load(target.place.buffer, place), Apply("mul", kind, factors)))
        inner.add(Store(target.place.buffer, place, total))

    left_shape, right_shape = (tuple(one.shape[axis] for axis in free) for one, free in ((left, left_free), (right, right_free)))
    swapped = prod(right_shape) == 1 and prod(left_shape) > 1
    slow_shape, fast_shape = (right_shape, left_shape) if swapped else (left_shape, right_shape)
    slow, middle = outer.loops(slow_shape)
    side = 1 if swapped else 0
    fixed = (
        element(right, right_batch, right_sum, right_free, slow) if swapped
        else element(left, left_batch, left_sum, left_free, slow)
    )
    fixed = middle.let(fixed)
    fast, innermost = middle.loops(fast_shape)
    both(innermost, fast if swapped else slow, slow if swapped else fast, {side: fixed})
    row = middle.inner()
    row.close(fast, fast_shape, innermost)
    middle.statements += _unless_zero(fixed, row.statements) if prod(fast_shape) >= 8 else row.statements
    outer.close(slow, slow_shape, middle)
    block.close(outer_index, outer_shape, outer)
    return target


def _unless_zero(factor: Expression, body: list[Statement]) -> list[Statement]:
    return [Branch(Apply("ne", "bool", (factor, Number(0, factor.kind))), tuple(body), ())]


def _clamped(block: Block, start: Expression, most: int) -> Expression:
    """A start index between 0 and the last one that there is room for."""
    if most <= 0:
        return Number(0)
    if isinstance(start, Number):
        return Number(min(max(int(start.value), 0), most))
    whole = start if start.kind == "int32" else Apply("convert", "int32", (start,))
    return block.let(Apply("min", "int32", (Apply("max", "int32", (whole, Number(0))), Number(most))))


def _dynamic_slice(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    value, *starts = operands
    room = [length - size for length, size in zip(value.shape, params["slice_sizes"], strict=True)]
    value = block.stored(value)
    first = [_clamped(block, start.read(()), most) for start, most in zip(starts, room, strict=True)]
    return moved(value, out.shape, range(len(first)), first, [1] * len(first))


def _dynamic_update_slice(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    value, update, *starts = operands
    target = block.empty(value.kind, value.shape)
    room = [length - size for length, size in zip(value.shape, update.shape, strict=True)]
    first = [_clamped(block, start.read(()), most) for start, most in zip(starts, room, strict=True)]
    block.copy(value, target)
    block.copy(update, moved(target, update.shape, range(len(first)), first, [1] * len(first)))
    return target


def _gather(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    value, indices = map(block.stored, operands)
    numbers, sizes = params["dimension_numbers"], params["slice_sizes"]
    fills = params["mode"] == jax.lax.GatherScatterMode.FILL_OR_DROP
    target = block.empty(str(out.dtype), out.shape)
    assert target.place is not None
    index, inner = block.loops(out.shape)
    offsets = [index[axis] for axis in numbers.offset_dims]
    batch = [step for axis, step in enumerate(index) if axis not in numbers.offset_dims]
    within = iter(offsets)
    gone = {*numbers.collapsed_slice_dims, *numbers.operand_batching_dims}
    there: list[Expression] = [Number(0) if axis in gone else next(within) for axis in range(len(value.shape))]
    for axis, along in zip(numbers.operand_batching_dims, numbers.start_indices_batching_dims, strict=True):
        there[axis] = batch[along]
    inside: list[Expression] = []
    for component, axis in enumerate(numbers.start_index_map):
        start, most = indices.read((*batch, Number(component))), value.shape[axis] - sizes[axis]
        if fills:
            start = inner.let(start if start.kind == "int32" else Apply("convert", "int32", (start,)))
            inside += [Apply("ge", "bool", (start, Number(0))), Apply("le", "bool", (start, Number(most)))]
        there[axis] = plus(there[axis], _clamped(inner, start, most))
    element = value.read(tuple(there))
    if inside:
        known = inside[0]
        for one in inside[1:]:
            known = Apply("and", "bool", (known, one))
        filler = params["fill_value"]
        if filler is None:
            filler = np.nan if value.kind.startswith("float") else _least(value.kind) if value.kind[0] == "i" else _greatest(value.kind)
        element = Apply("select", value.kind, (known, element, Number(filler, value.kind)))
    inner.add(Store(target.place.buffer, target.place.at(index), element))
    block.close(index, out.shape, inner)
    return target


def _bitcast(block: Block, operands: list[Value], params: Mapping[str, Any], out: Any) -> Value:
    return _elementwise("bitcast")(block, operands, params, out)


RULES: dict[str, Rule] = {
    **{name: _elementwise(name) for name in (*BINARY, *COMPARISONS, *SHIFTS, *UNARY)},
    "add_any": _elementwise("add"),
    "convert_element_type": _convert,
    "bitcast_convert_type": _bitcast,
    "integer_pow": _power,
    "round": _round,
    "select_n": _select,
    "clamp": _clamp,
    "broadcast_in_dim": _broadcast,
    "squeeze": _squeeze,
    "expand_dims": _expand,
    "transpose": _transpose,
    "slice": _slice,
    "rev": _reverse,
    "reshape": _reshape,
    "iota": _iota,
    **dict.fromkeys(("stop_gradient", "copy", "copy_p"), _same),
    "concatenate": _concatenate,
    "stack": _stack,
    "pad": _pad,
    **{f"reduce_{word}": _reduce(name) for word, name in
       (("sum", "add"), ("prod", "mul"), ("max", "max"), ("min", "min"), ("and", "and"), ("or", "or"), ("xor", "xor"))},
    "argmax": _arg("gt"),
    "argmin": _arg("lt"),
    **{f"cum{word}": _cumulative(name) for word, name in (("sum", "add"), ("prod", "mul"), ("max", "max"), ("min", "min"))},
    "dot_general": _dot,
    "dynamic_slice": _dynamic_slice,
    "dynamic_update_slice": _dynamic_update_slice,
    "gather": _gather,
}
"""By the name of the primitive."""
