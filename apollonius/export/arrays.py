"""Primitives of JAX that are loops: joining, folding along axes, products of matrices."""

from collections.abc import Callable, Sequence
from math import prod
from typing import Any

import numpy as np

from apollonius.export.block import Block, Index, Value, moved, part, scalar
from apollonius.export.elementwise import Params, Rule
from apollonius.export.expression import Expression, apply, converted, number, plus, times
from apollonius.export.statement import Nest

_WORTH_A_TEST = 8
"""Length of the inner loop of a product from which on a factor of 0 is looked for."""


def _joined(block: Block, pieces: Sequence[Value], axis: int, out: Any) -> Value:
    target, start = block.empty(str(out.dtype), out.shape), 0
    for piece in pieces:
        starts = [number(start if here == axis else 0) for here in range(len(out.shape))]
        block.copy(piece, part(target, piece.shape, starts))
        start += piece.shape[axis]
    return target


def _concatenate(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    return _joined(block, operands, int(params["dimension"]), out)


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
    target = block.empty(str(out.dtype), out.shape)
    block.copy(moved(filler, out.shape, []), target)
    block.copy(value, moved(target, value.shape, range(len(low)), list(map(number, low)), [gap + 1 for gap in gaps]))
    return target


def _folded(
    block: Block,
    shape: tuple[int, ...],
    axes: Sequence[int],
    firsts: Sequence[Expression],
    fold: Callable[[Block, Index, list[Expression]], list[Expression]],
    out: Any,
) -> Value:
    """Update variables along some axes of an operand, for each place along the others, and keep the last variable.

    Args:
        firsts: the variables' first values.
        fold: from the innermost block, the operand's index and the variables to their next values.
    """
    target = block.empty(str(out.dtype), out.shape)
    index, outer = block.loops(out.shape)
    held = [outer.variable(first) for first in firsts]
    lengths = tuple(shape[axis] for axis in axes)
    steps, inner = outer.loops(lengths)
    others, folded = iter(index), iter(steps)
    whole = tuple(next(folded) if axis in axes else next(others) for axis in range(len(shape)))
    for cell, value in zip(held, fold(inner, whole, [cell.at(number(0)) for cell in held]), strict=True):
        inner.set(cell, number(0), value)
    outer.close(steps, lengths, inner)
    outer.store(target, index, held[-1].at(number(0)))
    block.close(index, out.shape, outer)
    return target


def _least(kind: str) -> float | int | bool:
    return False if kind == "bool" else -np.inf if kind == "float32" else int(np.iinfo(kind).min)


def _greatest(kind: str) -> float | int | bool:
    return True if kind == "bool" else np.inf if kind == "float32" else int(np.iinfo(kind).max)


_FIRSTS: dict[str, Callable[[str], float | int | bool]] = {
    **{"add": lambda kind: 0, "mul": lambda kind: 1, "or": lambda kind: 0, "xor": lambda kind: 0},
    **{"and": lambda kind: True if kind == "bool" else -1, "max": _least, "min": _greatest},
}
"""The neutral element of each operation that folds."""


def _reduce(operation: str) -> Rule:
    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        (value,), kind = operands, str(out.dtype)

        def fold(inner: Block, index: Index, now: list[Expression]) -> list[Expression]:
            return [apply(operation, kind, now[0], value.read(index))]

        axes = sorted(int(axis) % len(value.shape) for axis in params["axes"])
        return _folded(block, value.shape, axes, [number(_FIRSTS[operation](kind), kind)], fold, out)

    return rule


def _argument_of(better: str, worst: Callable[[str], float | int | bool]) -> Rule:
    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        (value,), kind, (axis,) = operands, str(out.dtype), map(int, params["axes"])

        def fold(inner: Block, index: Index, now: list[Expression]) -> list[Expression]:
            best, where = now
            here = inner.let(value.read(index))
            is_better = inner.let(apply(better, "bool", here, best))
            places = is_better, converted(index[axis], kind), where
            return [apply("select", value.kind, is_better, here, best), apply("select", kind, *places)]

        firsts = [number(worst(value.kind), value.kind), number(0, kind)]
        return _folded(block, value.shape, [axis], firsts, fold, out)

    return rule


def _cumulative(operation: str) -> Rule:
    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        (value,), kind, axis = operands, str(out.dtype), int(params["axis"])
        target, length = block.empty(kind, out.shape), out.shape[axis]
        others = tuple(1 if here == axis else size for here, size in enumerate(out.shape))
        index, outer = block.loops(others)
        total = outer.variable(number(_FIRSTS[operation](kind), kind))
        (step,), inner = outer.loops((length,))
        here = plus(number(length - 1), times(step, -1)) if params["reverse"] else step
        at = tuple(here if place == axis else other for place, other in enumerate(index))
        inner.set(total, number(0), apply(operation, kind, total.at(number(0)), value.read(at)))
        inner.store(target, at, total.at(number(0)))
        outer.close((step,), (length,), inner)
        block.close(index, others, outer)
        return target

    return rule


def _dot(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    """Sum in the outer loop: the inner one runs along the result, and is left out where the factor that is the same for
    all of it is 0, as many outputs of rectifiers are.
    """
    left, right = map(block.stored, operands)
    (left_sum, right_sum), (left_batch, right_batch) = params["dimension_numbers"]
    kind, target = str(out.dtype), block.empty(str(out.dtype), out.shape)
    block.copy(scalar(number(0, kind), out.shape), target)
    shape = tuple(left.shape[axis] for axis in (*left_batch, *left_sum))
    index, outer = block.loops(shape)
    batch = index[: len(left_batch)]

    class Factor:
        """One operand: its axes in the order of the loops, and the lengths of those that only it has."""

        def __init__(self, value: Value, known: Sequence[int]) -> None:
            free = [axis for axis in range(len(value.shape)) if axis not in known]
            self.value, self.axes, self.shape = value, [*known, *free], tuple(value.shape[axis] for axis in free)

        def read(self, at: Index) -> Expression:
            place = dict(zip(self.axes, [*index, *at], strict=True))
            return self.value.read(tuple(place[axis] for axis in range(len(place))))

    factors = Factor(left, (*left_batch, *left_sum)), Factor(right, (*right_batch, *right_sum))
    turned = prod(factors[1].shape) == 1
    slow, fast = factors[::-1] if turned else factors
    slow_index, middle = outer.loops(slow.shape)
    fixed = middle.let(slow.read(slow_index))
    fast_index, innermost = middle.loops(fast.shape)
    at = (*batch, *fast_index, *slow_index) if turned else (*batch, *slow_index, *fast_index)
    product = apply("mul", kind, fixed, fast.read(fast_index))
    innermost.store(target, at, apply("add", kind, target.read(at), product))
    row = middle.inner()
    row.close(fast_index, fast.shape, innermost)
    if prod(fast.shape) >= _WORTH_A_TEST:
        is_other = apply("ne", "bool", fixed, number(0, kind))
        row.statements = [Nest(f"if ({is_other.text})", tuple(row.statements))]
    middle.statements += row.statements
    outer.close(slow_index, slow.shape, middle)
    block.close(index, shape, outer)
    return target


_OPERATIONS = {"sum": "add", "prod": "mul", "max": "max", "min": "min", "and": "and", "or": "or", "xor": "xor"}

FOLDS: dict[str, Rule] = {
    **{f"reduce_{word}": _reduce(operation) for word, operation in _OPERATIONS.items()},
    **{f"cum{word}": _cumulative(_OPERATIONS[word]) for word in ("sum", "prod", "max", "min")},
    "argmax": _argument_of("gt", _least),
    "argmin": _argument_of("lt", _greatest),
    "concatenate": _concatenate,
    "stack": _stack,
}
"""Primitives that read each element of an operand once, by name."""

PRODUCTS: dict[str, Rule] = {"pad": _pad, "dot_general": _dot}
"""Those that read some more than once, or not at all."""
