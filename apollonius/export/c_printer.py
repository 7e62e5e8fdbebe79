"""Statements and expressions in C99."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from apollonius.export.program import (
    Allocate,
    Apply,
    Branch,
    Buffer,
    Call,
    Expression,
    Function,
    Let,
    Load,
    Loop,
    Name,
    Number,
    Program,
    Slice,
    Statement,
    Store,
    While,
)

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


class Printer:
    """Prints functions, and remembers which helpers they call."""

    def __init__(self, program: Program) -> None:
        self.helpers: set[str] = set()
        self._lone = {record.name for record in program.records if record.lone}
        self._by_value = {record.name for record in program.arguments if record.lone and record.leaves[0].size == 1}

    def signature(self, function: Function) -> str:
        """Return the first line of a function."""
        given = [
            f"{TYPES[one.kind]} {one.name}" if isinstance(one, Name) else f"const {TYPES[one.kind]} *{one.name}"
            for one in function.parameters
        ]
        written = [f"{TYPES[one.kind]} *restrict {one.name}" for one in function.results]
        return f"static void {function.name}({', '.join([*given, *written])})"

    def block(self, statements: Sequence[Statement], depth: int = 0) -> str:
        """Return statements in braces."""
        lines = [line for statement in statements for line in self.statement(statement, depth + 1)]
        return "\n".join(["{", *lines, "    " * depth + "}"])

    def statement(self, statement: Statement, depth: int) -> Iterator[str]:
        """Yield the lines of one statement."""
        space = "    " * depth
        match statement:
            case Let(name, value):
                yield f"{space}const {TYPES[name.kind]} {name.name} = {self.expression(value)};"
            case Allocate(buffer):
                size = "" if buffer.cell else f"[{buffer.size}]"
                yield f"{space}{TYPES[buffer.kind]} {buffer.name}{size};"
            case Store(buffer, index, value):
                yield f"{space}{self.element(buffer, index)} = {self.expression(value)};"
            case Loop(counter, count, body):
                heading = f"for (int32_t {counter.name} = 0; {counter.name} < {count}; {counter.name}++)"
                yield f"{space}{heading} {self.block(body, depth)}"
            case While(before, condition, body):
                leave = f"{space}    if (!{self.expression(condition)})\n{space}        break;"
                lines = [line for one in before for line in self.statement(one, depth + 1)]
                lines += [leave, *(line for one in body for line in self.statement(one, depth + 1))]
                yield "\n".join([f"{space}for (;;) {{", *lines, f"{space}}}"])
            case Branch(condition, true, false):
                otherwise = f" else {self.block(false, depth)}" if false else ""
                yield f"{space}if ({self.expression(condition)}) {self.block(true, depth)}{otherwise}"
            case Call(function, arguments):
                yield f"{space}{function}({', '.join(map(self.argument, arguments))});"

    def argument(self, argument: Expression | Slice) -> str:
        """Return what a function is given."""
        if not isinstance(argument, Slice):
            return self.expression(argument)
        name = self.array(argument.buffer)
        return name if argument.offset == Number(0) else f"{name} + {self.expression(argument.offset)}"

    def array(self, buffer: Buffer) -> str:
        """Return the name of an array."""
        if buffer.leaf is None:
            return buffer.name
        record, leaf = buffer.leaf
        return record if record in self._lone else f"{record}->{leaf}"

    def element(self, buffer: Buffer, index: Expression) -> str:
        """Return an element of an array."""
        name = self.array(buffer)
        if buffer.cell or (buffer.leaf and buffer.size == 1):
            pointer = buffer.leaf is not None and buffer.leaf[0] in self._lone - self._by_value
            return f"*{name}" if pointer else name
        return f"{name}[{self.expression(index)}]"

    def expression(self, expression: Expression) -> str:
        """Return an expression, in brackets where that could matter."""
        match expression:
            case Number(value, kind):
                return literal(value, kind)
            case Name(name, _):
                return name
            case Load(buffer, index):
                return self.element(buffer, index)
            case Apply(operation, kind, operands):
                return self.apply(operation, kind, operands[0].kind, *map(self.expression, operands))

    def apply(self, operation: str, kind: str, of: str, *given: str) -> str:
        """Return an operation on operands of the kind `of`."""
        real = of == "float32"
        if operation in _SIGNS:
            both = f"({given[0]} {_SIGNS[operation]} {given[1]})"
            return f"({TYPES[kind]}){both}" if kind in ("uint8", "uint16", "int8", "int16") else both
        match operation:
            case "select":
                return f"({given[0]} ? {given[1]} : {given[2]})"
            case "convert":
                return self.converted(kind, of, given[0])
            case "neg":
                return f"(-{given[0]})"
            case "not":
                return f"(!{given[0]})" if kind == "bool" else f"(~{given[0]})"
            case "max" | "min" if not real:
                return f"({given[0]} {'>' if operation == 'max' else '<'} {given[1]} ? {given[0]} : {given[1]})"
            case "max" | "min":
                return self.helper("largest" if operation == "max" else "least", *given)
            case "rem" if not real:
                return f"({given[0]} % {given[1]})"
            case "abs" if not real:
                return f"({given[0]} < 0 ? -{given[0]} : {given[0]})"
            case "sign" if not real:
                return f"(({given[0]} > 0) - ({given[0]} < 0))"
            case "rsqrt":
                return f"(1 / sqrtf({given[0]}))"
            case "is_finite":
                return f"(isfinite({given[0]}) != 0)"
            case "sign" | "logistic":
                return self.helper(operation, *given)
            case "bitcast":
                return self.helper("to_bits" if real else "from_bits", *given)
            case "shift_left":
                return f"({TYPES[kind]})({given[1]} < 32 ? (uint32_t){given[0]} << {given[1]} : 0)"
            case "shift_right_logical":
                return f"({TYPES[kind]})({given[1]} < 32 ? (uint32_t){given[0]} >> {given[1]} : 0)"
            case "shift_right_arithmetic":
                return f"({given[0]} >> ({given[1]} < 31 ? {given[1]} : 31))"
            case _ if operation in _LIBRARY and real:
                return f"{_LIBRARY[operation]}({', '.join(given)})"
            case _:
                raise NotImplementedError(f"{operation} of {of}")

    def converted(self, kind: str, of: str, given: str) -> str:
        """Return a number as one of another kind."""
        if kind == "bool":
            return f"({given} != 0)"
        if of != "float32" or kind == "float32":
            return f"(({TYPES[kind]}){given})"
        whole = self.helper("to_uint32" if kind.startswith("u") else "to_int32", given)
        return whole if kind in ("int32", "uint32") else f"(({TYPES[kind]}){whole})"

    def helper(self, name: str, *given: str) -> str:
        """Return the call of a helper."""
        self.helpers.add(name)
        return f"op_{name}({', '.join(given)})"


def literal(value: Any, kind: str) -> str:
    """Return a number exactly."""
    if kind == "float32":
        if not np.isfinite(value):
            return "NAN" if np.isnan(value) else "INFINITY" if value > 0 else "(-INFINITY)"
        text = f"{np.float32(value)!s}f"
    elif value == np.iinfo("int32").min and kind == "int32":
        text = "INT32_MIN"
    else:
        text = f"{int(value)}{'u' if kind == 'uint32' else ''}"
    return f"({text})" if text.startswith("-") else text
