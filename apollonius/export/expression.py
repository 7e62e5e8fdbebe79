"""Scalars in C99, computed here as far as their operands are known."""

import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

INDEX = "int32"
"""The kind of counters and indices."""
TYPES = {
    "float32": "float",
    "int32": "int32_t",
    "uint32": "uint32_t",
    "bool": "uint8_t",
    "uint8": "uint8_t",
    "uint16": "uint16_t",
    "int8": "int8_t",
    "int16": "int16_t",
}
"""By the names of NumPy's types, which are the kinds of scalars."""
_SIGNS = {
    "add": "+",
    "sub": "-",
    "mul": "*",
    "div": "/",
    "and": "&",
    "or": "|",
    "xor": "^",
    "eq": "==",
    "ne": "!=",
    "lt": "<",
    "le": "<=",
    "gt": ">",
    "ge": ">=",
}
_ROOTS = ("floor", "ceil", "sqrt", "cbrt", "exp", "exp2", "expm1", "log", "log1p", "pow", "atan2")
_ANGLES = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh")
_LIBRARY = {
    **{name: f"{name}f" for name in (*_ROOTS, *_ANGLES)},
    **{"abs": "fabsf", "rem": "fmodf", "round_even": "rintf", "round_away": "roundf"},
}
HELPERS = {
    "largest": "static inline float op_largest(float a, float b) { return a != a || a > b ? a : b; }",
    "least": "static inline float op_least(float a, float b) { return a != a || a < b ? a : b; }",
    "sign": "static inline float op_sign(float x) { return x > 0 ? 1 : x < 0 ? -1 : x; }",
    "logistic": "static inline float op_logistic(float x) { return 1 / (1 + expf(-x)); }",
    "to_int32": """static inline int32_t op_to_int32(float x)
{
    return x != x ? 0 : x >= 2147483648.0f ? INT32_MAX : x <= -2147483648.0f ? INT32_MIN : (int32_t)x;
}""",
    "to_uint32": """static inline uint32_t op_to_uint32(float x)
{
    return x != x || x <= 0 ? 0 : x >= 4294967296.0f ? UINT32_MAX : (uint32_t)x;
}""",
    "to_bits": """static inline uint32_t op_to_bits(float x)
{
    union { float x; uint32_t bits; } both = {x};
    return both.bits;
}""",
    "from_bits": """static inline float op_from_bits(uint32_t bits)
{
    union { uint32_t bits; float x; } both = {bits};
    return both.x;
}""",
}
_KNOWN: dict[str, Callable[..., Any]] = {
    **{name: getattr(operator, name) for name in ("add", "sub", "mul", "eq", "ne", "lt", "le", "gt", "ge", "neg")},
    **{"and": operator.and_, "or": operator.or_, "max": max, "min": min, "not": operator.not_},
    "sign": lambda x: (x > 0) - (x < 0),
}
"""Operations on whole numbers and truths that are computed here where their operands are literals."""


@dataclass(frozen=True)
class Expression:
    """A scalar.

    Attributes:
        text: in C, in brackets where that could matter.
        kind: the name of its NumPy type.
        known: its value, if it is a literal.
        named: whether it is a name whose value never changes.
    """

    text: str
    kind: str = INDEX
    known: float | int | bool | None = None
    named: bool = False

    @property
    def free(self) -> bool:
        """Return whether reading it costs nothing."""
        return self.named or self.known is not None


def number(value: float | int | bool, kind: str = INDEX) -> Expression:
    """Return a literal, exactly."""
    if kind == "float32" and not np.isfinite(value):
        text = "NAN" if np.isnan(value) else "INFINITY" if value > 0 else "-INFINITY"
    elif kind == "float32":
        text = f"{np.float32(value)!s}f"
    elif value == np.iinfo("int32").min and kind == "int32":
        text = "INT32_MIN"
    else:
        text = f"{int(value)}{'u' if kind == 'uint32' else ''}"
    return Expression(f"({text})" if text.startswith("-") else text, kind, value)


def name(text: str, kind: str = INDEX) -> Expression:
    """Return what a name stands for: a parameter, a loop's counter or a constant."""
    return Expression(text, kind, named=True)


def apply(operation: str, kind: str, *operands: Expression) -> Expression:
    """Return an operation, on scalars of one kind unless it is a conversion, a comparison or a choice.

    Raises:
        NotImplementedError: for an operation that C does not have for numbers of that kind.
    """
    first, *_ = operands
    if operation == "select" and first.known is not None:
        return operands[1] if first.known else operands[2]
    literals = [one.known for one in operands if one.known is not None and one.kind in ("int32", "bool")]
    known = operation in _KNOWN and len(literals) == len(operands) and (operation != "not" or kind == "bool")
    if known and abs(value := int(_KNOWN[operation](*literals))) < 2**31:
        return number(bool(value) if kind == "bool" else value, kind)
    return Expression(_text(operation, kind, first.kind, *(one.text for one in operands)), kind)


def _text(operation: str, kind: str, of: str, *given: str) -> str:
    real, (one, *rest) = of == "float32", given
    if operation in _SIGNS:
        both = f"({one} {_SIGNS[operation]} {rest[0]})"
        return f"({TYPES[kind]}){both}" if kind in ("uint8", "uint16", "int8", "int16") else both
    match operation:
        case "select":
            return f"({one} ? {rest[0]} : {rest[1]})"
        case "convert":
            return _converted(kind, of, one)
        case "neg":
            return f"(-{one})"
        case "not":
            return f"(!{one})" if kind == "bool" else f"(~{one})"
        case "max" | "min" if not real:
            return f"({one} {'>' if operation == 'max' else '<'} {rest[0]} ? {one} : {rest[0]})"
        case "rem" if not real:
            return f"({one} % {rest[0]})"
        case "abs" if not real:
            return f"({one} < 0 ? -{one} : {one})"
        case "sign" if not real:
            return f"(({one} > 0) - ({one} < 0))"
        case "rsqrt":
            return f"(1 / sqrtf({one}))"
        case "is_finite":
            return f"(isfinite({one}) != 0)"
        case "max" | "min":
            return f"op_{'largest' if operation == 'max' else 'least'}({one}, {rest[0]})"
        case "sign" | "logistic":
            return f"op_{operation}({one})"
        case "bitcast":
            return f"op_{'to' if real else 'from'}_bits({one})"
        case "shift_left" | "shift_right_logical":
            way = "<<" if operation == "shift_left" else ">>"
            return f"({TYPES[kind]})({rest[0]} < 32 ? (uint32_t){one} {way} {rest[0]} : 0)"
        case "shift_right_arithmetic":
            return f"({one} >> ({rest[0]} < 31 ? {rest[0]} : 31))"
        case _ if operation in _LIBRARY and real:
            return f"{_LIBRARY[operation]}({', '.join(given)})"
        case _:
            raise NotImplementedError(f"{operation} of {of}")


def _converted(kind: str, of: str, given: str) -> str:
    if kind == "bool":
        return f"({given} != 0)"
    if of != "float32" or kind == "float32":
        return f"(({TYPES[kind]}){given})"
    whole = f"op_{'to_uint32' if kind.startswith('u') else 'to_int32'}({given})"
    return whole if kind in ("int32", "uint32") else f"(({TYPES[kind]}){whole})"


def converted(expression: Expression, kind: str) -> Expression:
    """Return a number as one of another kind."""
    if expression.kind == kind:
        return expression
    if expression.known is not None:
        return number(np.asarray(expression.known).astype(kind).item(), kind)
    return apply("convert", kind, expression)


def plus(one: Expression, other: Expression) -> Expression:
    """Return the sum of two indices."""
    if one.known is not None:
        one, other = other, one
    return one if other.known == 0 and one.known is None else apply("add", INDEX, one, other)


def times(one: Expression, factor: int) -> Expression:
    """Return a multiple of an index."""
    if factor == 0:
        return number(0)
    return one if factor == 1 else apply("mul", INDEX, one, number(factor))
