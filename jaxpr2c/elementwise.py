"""Primitives of JAX whose results are computed as they are read: operations on numbers, and other
views of an array.
"""

from collections.abc import Callable, Mapping
from typing import Any

import jax

from jaxpr2c.block import Block, Index, Value, scalar, shift, value_at
from jaxpr2c.scalars import OPERATIONS, apply_operation, bits_of, convert, number

Params = Mapping[str, Any]
Rule = Callable[[Block, list[Value], Params, Any], Value]
"""From the block to write in, the operands, the parameters and the type of the result to that
result.
"""


def broadcast_element(value: Value, index: Index) -> str:
    """Return an operand's element: axes of length 1 are broadcast, and so is a lone number."""
    steps = zip(index[: len(value.shape)], value.shape, strict=True)
    return value.read(tuple("0" if length == 1 else step for step, length in steps))


def elementwise(operation: str) -> Rule:
    """Return the rule of an operation on numbers."""

    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        kind = str(out.dtype)
        operand_kind = operands[0].kind
        # Kinds are refused here, where the line is known.
        apply_operation(operation, kind, operand_kind, *[""] * len(operands))

        def read(index: Index) -> str:
            return apply_operation(
                operation,
                kind,
                operand_kind,
                *(broadcast_element(operand, index) for operand in operands),
            )

        return Value(kind, out.shape, read, pending=True)

    return rule


def is_at_most(text: str, kind: str, case: int) -> str:
    """Check whether a choice, a truth or a number, is one of the first cases up to this one."""
    return f"(!{text})" if kind == "bool" else f"({text} <= {number(case, kind)})"


def _as(change: Callable[[str, str, str], str]) -> Rule:
    """Return the rule of a change of kind."""

    def rule(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
        (value,) = operands
        kind = str(out.dtype)
        if value.kind == kind:
            return value
        change("", value.kind, kind)  # refuses kinds here, where the line is known

        def read(index: Index) -> str:
            return change(value.read(index), value.kind, kind)

        return Value(kind, out.shape, read, pending=True)

    return rule


def _power(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    """Multiply by squares, squares of squares and so on, as XLA does."""
    value, exponent = block.as_stored(operands[0]), int(params.get("y", 2))
    kind = value.kind

    def read(index: Index) -> str:
        product = ""
        factor = value.read(index)
        remaining_exponent = abs(exponent)
        while remaining_exponent:
            if remaining_exponent % 2:
                product = apply_operation("mul", kind, kind, product, factor) if product else factor
            factor = apply_operation("mul", kind, kind, factor, factor)
            remaining_exponent //= 2
        product = product or number(1, kind)
        return (
            product
            if exponent >= 0
            else apply_operation("div", kind, kind, number(1, kind), product)
        )

    return Value(kind, out.shape, read, pending=True)


def _round(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    to_even = params["rounding_method"] == jax.lax.RoundingMethod.TO_NEAREST_EVEN
    return elementwise("round_even" if to_even else "round_away")(block, operands, params, out)


def _select(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    which, *cases = operands

    def read(index: Index) -> str:
        expression = broadcast_element(cases[-1], index)
        case_text = broadcast_element(which, index)
        for case in range(len(cases) - 2, -1, -1):
            test = is_at_most(case_text, which.kind, case)
            expression = f"({test} ? {broadcast_element(cases[case], index)} : {expression})"
        return expression

    return Value(str(out.dtype), out.shape, read, pending=True)


def _clamp(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    low, value, high = operands
    above = elementwise("max")(block, [value, low], params, out)
    return elementwise("min")(block, [above, high], params, out)


def _iota(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    kind, axis = str(out.dtype), int(params["dimension"])
    return Value(kind, out.shape, lambda index: convert(index[axis], "int32", kind))


def _broadcast(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    (value,) = operands
    axes = zip(params["broadcast_dimensions"], value.shape, strict=True)
    return shift(value, out.shape, [None if length == 1 else int(axis) for axis, length in axes])


def _squeeze(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    (value,) = operands
    num_axes = len(value.shape)
    squeezed = {axis % num_axes for axis in params["dimensions"]}
    output_axes = iter(range(len(out.shape)))
    axes = [None if axis in squeezed else next(output_axes) for axis in range(num_axes)]
    return shift(value, out.shape, axes)


def _transpose(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    order = params["permutation"]
    return shift(operands[0], out.shape, [order.index(axis) for axis in range(len(order))])


def _slice(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    starts = [str(start) for start in params["start_indices"]]
    steps = [int(step) for step in params["strides"] or [1] * len(out.shape)]
    return shift(operands[0], out.shape, range(len(starts)), starts, steps)


def _reverse(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    is_reversed = [axis in params["dimensions"] for axis in range(len(out.shape))]
    starts = [
        str(length - 1 if reverse else 0)
        for length, reverse in zip(out.shape, is_reversed, strict=True)
    ]
    steps = [-1 if reverse else 1 for reverse in is_reversed]
    return shift(operands[0], out.shape, range(len(is_reversed)), starts, steps)


def _reshape(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value = block.as_contiguous(operands[0])
    if value.location is None or value.size == 1:
        return scalar(value.kind, value.first, out.shape)
    return value_at(value.kind, out.shape, value.location.buffer, value.location.offset)


def _tile(block: Block, operands: list[Value], params: Params, out: Any) -> Value:
    value = block.as_stored(operands[0])
    new = len(out.shape) - len(value.shape)

    def read(index: Index) -> str:
        steps = zip(index[new:], value.shape, strict=True)
        return value.read(tuple(f"({step} % {length})" for step, length in steps))

    return Value(value.kind, out.shape, read)


COMPUTED: dict[str, Rule] = {
    **{name: elementwise(name) for name in OPERATIONS},
    "add_any": elementwise("add"),
    "bitcast_convert_type": _as(bits_of),
    "convert_element_type": _as(convert),
    **dict.fromkeys(("integer_pow", "square"), _power),
    "round": _round,
    "select_n": _select,
    "clamp": _clamp,
}
"""Operations on numbers, by the name of the primitive."""

VIEWS: dict[str, Rule] = {
    "broadcast_in_dim": _broadcast,
    "squeeze": _squeeze,
    "transpose": _transpose,
    "slice": _slice,
    "rev": _reverse,
    "reshape": _reshape,
    "tile": _tile,
    "iota": _iota,
    **dict.fromkeys(("stop_gradient", "copy"), lambda block, operands, params, out: operands[0]),
}
"""Other views, which move nothing."""
