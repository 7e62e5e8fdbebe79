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
_ROOTS = ("floor", "ceil", "sqrt", "cbrt", "exp", "exp2", "expm1", "log", "log1p", "pow", "atan2")
_ANGLES = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh")
_LIBRARY = {
    **{name: f"{name}f" for name in (*_ROOTS, *_ANGLES)},
    **{"abs": "fabsf", "rem": "fmodf", "round_even": "rintf", "round_away": "roundf"},
}
FUNCTIONS = frozenset({*_LIBRARY.values(), "expf", "sqrtf"})
"""Functions of the C library that programs call."""
HELPERS = {
    "largest": """static inline float op_largest(float a, float b)
{
    return a != a || a > b || (a == b && !signbit(a)) ? a : b;
}""",
    "least": """static inline float op_least(float a, float b)
{
    return a != a || a < b || (a == b && signbit(a)) ? a : b;
}""",
    "quotient": """static inline int32_t op_quotient(int32_t a, int32_t b)
{
    return b == 0 ? -1 : b == -1 ? (int32_t)(0u - (uint32_t)a) : a / b;
}""",
    "remainder": """static inline int32_t op_remainder(int32_t a, int32_t b)
{
    return b == 0 ? a : b == -1 ? 0 : a % b;
}""",
    "uquotient": (
        "static inline uint32_t op_uquotient(uint32_t a, uint32_t b) "
        "{ return b ? a / b : UINT32_MAX; }"
    ),
    "uremainder": (
        "static inline uint32_t op_uremainder(uint32_t a, uint32_t b) { return b ? a % b : a; }"
    ),
    "left": (
        "static inline uint32_t op_left(uint32_t x, uint32_t by) { return by < 32 ? x << by : 0; }"
    ),
    "right": (
        "static inline uint32_t op_right(uint32_t x, uint32_t by) { return by < 32 ? x >> by : 0; }"
    ),
    "arithmetic": """static inline int32_t op_arithmetic(int32_t x, uint32_t by)
{
    uint32_t most = by < 31 ? by : 31;
    return x < 0 ? ~(~x >> most) : x >> most;
}""",
    "sign": "static inline float op_sign(float x) { return x > 0 ? 1 : x < 0 ? -1 : x; }",
    "logistic": "static inline float op_logistic(float x) { return 1 / (1 + expf(-x)); }",
    "to_int32": """static inline int32_t op_to_int32(float x)
{
    return x != x ? 0 : x >= 2147483648.0f ? INT32_MAX : \
x <= -2147483648.0f ? INT32_MIN : (int32_t)x;
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
_COMPARED = {
    name: f"({{0}} {sign} {{1}})"
    for name, sign in {"eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">="}.items()
}
_FLOATS = {
    **_COMPARED,
    **{
        name: f"({{0}} {sign} {{1}})"
        for name, sign in {"add": "+", "sub": "-", "mul": "*", "div": "/"}.items()
    },
    **{name: f"{function}({{0}})" for name, function in _LIBRARY.items()},
    **{name: f"{_LIBRARY[name]}({{0}}, {{1}})" for name in ("pow", "atan2", "rem")},
    "neg": "(-{0})",
    "max": "op_largest({0}, {1})",
    "min": "op_least({0}, {1})",
    "sign": "op_sign({0})",
    "logistic": "op_logistic({0})",
    "rsqrt": "(1 / sqrtf({0}))",
    "is_finite": "(isfinite({0}) != 0)",
}
_WHOLE = {
    **_COMPARED,
    **{name: f"({{0}} {sign} {{1}})" for name, sign in {"and": "&", "or": "|", "xor": "^"}.items()},
    **{
        name: f"(({{kind}})((uint32_t){{0}} {sign} (uint32_t){{1}}))"
        for name, sign in {"add": "+", "sub": "-", "mul": "*"}.items()
    },
    "div": "(({kind})op_{u}quotient({0}, {1}))",
    "rem": "(({kind})op_{u}remainder({0}, {1}))",
    "neg": "(({kind})(0u - (uint32_t){0}))",
    "not": "(({kind})~{0})",
    "max": "({0} > {1} ? {0} : {1})",
    "min": "({0} < {1} ? {0} : {1})",
    "abs": "({0} < 0 ? ({kind})(0u - (uint32_t){0}) : {0})",
    "sign": "(({0} > 0) - ({0} < 0))",
    "shift_left": "(({kind})op_left((uint32_t){0}, (uint32_t){1}))",
    "shift_right_logical": "(({kind})op_right(({unsigned}){0}, (uint32_t){1}))",
    "shift_right_arithmetic": "(({kind})op_arithmetic(({signed}){0}, (uint32_t){1}))",
}
"""Of whole numbers, as JAX defines them: sums go around, and nothing that C leaves undefined is
asked of it.
"""
OPERATIONS = (*_FLOATS, *_WHOLE)
"""Operations of `apply_operation`: names of JAX's primitives, apart from the two roundings."""


def number(value: float | int | bool, kind: str) -> str:
    """Return a literal, exactly, in brackets if it is negative."""
    if kind == "float32" and not np.isfinite(value):
        infinity = "INFINITY" if value > 0 else "-INFINITY"
        text = "NAN" if np.isnan(value) else infinity
    elif kind == "float32":
        text = f"{np.float32(value)!s}f"
    elif value == np.iinfo("int32").min and kind == "int32":
        text = "INT32_MIN"
    else:
        text = f"{int(value)}{'u' if kind == 'uint32' else ''}"
    return f"({text})" if text.startswith("-") else text


def apply_operation(operation: str, kind: str, operand_kind: str, *operands: str) -> str:
    """Write an operation in C, in brackets where that could matter.

    Args:
        operation: Name of the operation, one of `OPERATIONS`.
        kind: Kind of the result.
        operand_kind: Kind of the first operand.
        operands: The operands, in C.

    Raises:
        NotImplementedError: If C has no such operation for such numbers.
    """
    if operation == "not" and kind == "bool":
        return f"(!{operands[0]})"
    templates = _FLOATS if operand_kind == "float32" else _WHOLE
    if operation not in templates:
        raise NotImplementedError(f"{operation} of {operand_kind}")
    if operand_kind in ("bool", "float32"):
        return templates[operation].format(*operands, kind=TYPES[kind])
    bits = np.iinfo(operand_kind).bits
    types = {"kind": TYPES[kind], "signed": f"int{bits}_t", "unsigned": f"uint{bits}_t"}
    return templates[operation].format(
        *operands, **types, u="u" if operand_kind.startswith("u") else ""
    )


def bits_of(text: str, of: str, kind: str) -> str:
    """Return the number of a kind that has the bits of another; raises NotImplementedError for
    kinds of other sizes.
    """
    if np.dtype(of).itemsize != np.dtype(kind).itemsize:
        raise NotImplementedError(f"{of} to {kind}")
    if of == kind:
        return text
    text = f"op_to_bits({text})" if of == "float32" else text
    return f"op_from_bits({text})" if kind == "float32" else f"(({TYPES[kind]}){text})"


def convert(text: str, of: str, kind: str) -> str:
    """Return a number of one kind as one of another kind."""
    if of == kind:
        return text
    if kind == "bool":
        return f"({text} != 0)"
    if of != "float32":
        return f"(({TYPES[kind]}){text})"
    if kind in ("int32", "uint32"):
        return f"op_to_{kind}({text})"
    least, most = (number(float(bound), of) for bound in (np.iinfo(kind).min, np.iinfo(kind).max))
    return f"(({TYPES[kind]})op_to_int32(op_least(op_largest({text}, {least}), {most})))"


def plus(first: str, second: str) -> str:
    if first.isdigit() and second.isdigit():
        return str(int(first) + int(second))
    if first == "0":
        return second
    return first if second == "0" else f"({first} + {second})"


def times(index: str, factor: int) -> str:
    if index.isdigit() and factor >= 0:
        return str(int(index) * factor)
    if factor == 0:
        return "0"
    return index if factor == 1 else f"({index} * {factor})"
