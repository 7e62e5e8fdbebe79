"""Numbers in C99, and operations on them."""

import numpy as np

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
"""By the names of NumPy's types, which are the kinds of numbers."""
_SIGNS = {
    **{"add": "+", "sub": "-", "mul": "*", "div": "/", "and": "&", "or": "|", "xor": "^"},
    **{"eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">="},
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
_FLOATS = {
    "max": "op_largest({0}, {1})",
    "min": "op_least({0}, {1})",
    "sign": "op_sign({0})",
    "logistic": "op_logistic({0})",
    "rsqrt": "(1 / sqrtf({0}))",
    "is_finite": "(isfinite({0}) != 0)",
    "bitcast": "op_to_bits({0})",
}
_WHOLE = {
    "max": "({0} > {1} ? {0} : {1})",
    "min": "({0} < {1} ? {0} : {1})",
    "rem": "({0} % {1})",
    "abs": "({0} < 0 ? -{0} : {0})",
    "sign": "(({0} > 0) - ({0} < 0))",
    "bitcast": "op_from_bits({0})",
    "shift_left": "(uint32_t)({1} < 32 ? (uint32_t){0} << {1} : 0)",
    "shift_right_logical": "(uint32_t)({1} < 32 ? (uint32_t){0} >> {1} : 0)",
    "shift_right_arithmetic": "({0} >> ({1} < 31 ? {1} : 31))",
}
OPERATIONS = ("neg", "not", *_SIGNS, *_LIBRARY, *_FLOATS, *_WHOLE)
"""Operations of `apply`: names of JAX's primitives, apart from the two roundings and `bitcast`."""


def number(value: float | int | bool, kind: str) -> str:
    """Return a literal, exactly, in brackets if it is negative."""
    if kind == "float32" and not np.isfinite(value):
        text = "NAN" if np.isnan(value) else "INFINITY" if value > 0 else "-INFINITY"
    elif kind == "float32":
        text = f"{np.float32(value)!s}f"
    elif value == np.iinfo("int32").min and kind == "int32":
        text = "INT32_MIN"
    else:
        text = f"{int(value)}{'u' if kind == 'uint32' else ''}"
    return f"({text})" if text.startswith("-") else text


def apply(operation: str, kind: str, of: str, *given: str) -> str:
    """Return an operation on operands, the first `of` one kind, whose result is of a kind, in brackets where that could
    matter; raises NotImplementedError for an operation that C does not have for such numbers.
    """
    if operation in _SIGNS:
        both = f"({given[0]} {_SIGNS[operation]} {given[1]})"
        return f"({TYPES[kind]}){both}" if kind in ("uint8", "uint16", "int8", "int16") else both
    if operation == "neg":
        return f"(-{given[0]})"
    if operation == "not":
        return f"(!{given[0]})" if kind == "bool" else f"(~{given[0]})"
    if of == "float32" and operation in _LIBRARY:
        return f"{_LIBRARY[operation]}({', '.join(given)})"
    known = _FLOATS if of == "float32" else _WHOLE
    if operation not in known:
        raise NotImplementedError(f"{operation} of {of}")
    return known[operation].format(*given)


def converted(text: str, of: str, kind: str) -> str:
    """Return a number of one kind as one of another kind."""
    if of == kind:
        return text
    if kind == "bool":
        return f"({text} != 0)"
    if of != "float32":
        return f"(({TYPES[kind]}){text})"
    whole = f"op_{'to_uint32' if kind.startswith('u') else 'to_int32'}({text})"
    return whole if kind in ("int32", "uint32") else f"(({TYPES[kind]}){whole})"


def plus(one: str, other: str) -> str:
    if one.isdigit() and other.isdigit():
        return str(int(one) + int(other))
    return other if one == "0" else one if other == "0" else f"({one} + {other})"


def times(index: str, factor: int) -> str:
    if index.isdigit() and factor >= 0:
        return str(int(index) * factor)
    return "0" if factor == 0 else index if factor == 1 else f"({index} * {factor})"
