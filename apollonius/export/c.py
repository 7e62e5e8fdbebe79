"""A program in C99: a header with a struct for each argument, and a source that needs the C library's mathematics only.

It allocates nothing and keeps no state. Compiled by the standard (`-std=c99`), products and sums are rounded one by one,
as in Python.
"""

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
    Record,
    Slice,
    Statement,
    Store,
    While,
    parts,
)

_TYPES = {
    "float32": "float", "int32": "int32_t", "uint32": "uint32_t", "bool": "uint8_t",
    "uint8": "uint8_t", "uint16": "uint16_t", "int8": "int8_t", "int16": "int16_t",
}
_SIGNS = {
    "add": "+", "sub": "-", "mul": "*", "div": "/", "and": "&", "or": "|", "xor": "^",
    "eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">=",
}
_LIBRARY = {
    name: f"{name}f" for name in
    "floor ceil sqrt exp exp2 expm1 log log1p sin cos tan asin acos atan sinh cosh tanh cbrt pow atan2".split()
} | {"abs": "fabsf", "rem": "fmodf", "round_even": "rintf", "round_away": "roundf"}
_HELPERS = {
    "largest": "static inline float largest(float a, float b) { return a != a || a > b ? a : b; }",
    "least": "static inline float least(float a, float b) { return a != a || a < b ? a : b; }",
    "square": "static inline float square(float x) { return x * x; }",
    "sign": "static inline float sign(float x) { return x > 0 ? 1 : x < 0 ? -1 : x; }",
    "logistic": "static inline float logistic(float x) { return 1 / (1 + expf(-x)); }",
    "power": """static inline float power(float x, int32_t n)
{
    float product = 1, factor = x;
    for (int32_t left = n < 0 ? -n : n; left > 0; left >>= 1) {
        if (left & 1)
            product *= factor;
        factor *= factor;
    }
    return n < 0 ? 1 / product : product;
}""",
    "to_int32": """static inline int32_t to_int32(float x)
{
    return x != x ? 0 : x >= 2147483648.0f ? INT32_MAX : x <= -2147483648.0f ? INT32_MIN : (int32_t)x;
}""",
    "to_uint32": """static inline uint32_t to_uint32(float x)
{
    return x != x || x <= 0 ? 0 : x >= 4294967296.0f ? UINT32_MAX : (uint32_t)x;
}""",
    "to_bits": "static inline uint32_t to_bits(float x) { union { float x; uint32_t bits; } both = { x }; return both.bits; }",
    "from_bits": "static inline float from_bits(uint32_t bits) { union { uint32_t bits; float x; } both = { bits }; return both.x; }",
}
_PER_LINE = 8


def header(program: Program) -> str:
    """Return the header: the structs and the function."""
    guard = f"{program.name.upper()}_H"
    structs = "\n\n".join(_struct(program, record) for record in _structs(program))
    return f"#ifndef {guard}\n#define {guard}\n\n#include <stdint.h>\n\n{structs}\n\n{_signature(program)};\n\n#endif\n"


def source(program: Program) -> str:
    """Return the source, which includes the header."""
    printer = _Printer(program)
    *functions, entry = program.functions
    bodies = [f"{printer.signature(function)}\n{printer.block(function.body)}" for function in functions]
    used = {part.leaf[0] for part in parts(entry.body) if isinstance(part, Buffer) and part.leaf}
    given = [record.name for record in program.arguments if record.leaves]
    ignored = [f"    (void){name};" for name in given if name not in used]
    opened, *lines = printer.block(entry.body).splitlines()
    bodies.append("\n".join([_signature(program), opened, *ignored, *lines]))
    constants = [
        f"static const {_TYPES[buffer.kind]} {buffer.name}[{buffer.size}] = {{\n{_rows(array, buffer.kind)}\n}};"
        for buffer, array in program.constants
    ]
    helpers = [text for name, text in _HELPERS.items() if name in printer.helpers]
    opening = f'#include "{program.name}.h"\n\n#include <math.h>'
    return "\n\n".join([opening, *helpers, *constants, *bodies]) + "\n"


def _structs(program: Program) -> Iterator[Record]:
    """The records that are structs, each layout once."""
    seen = set()
    for record in program.records:
        if not _is_lone(record) and record.leaves not in seen:
            seen.add(record.leaves)
            yield record


def _is_lone(record: Record) -> bool:
    """Whether it is an array and no pytree."""
    return len(record.leaves) == 1 and not record.leaves[0].name


def _struct(program: Program, record: Record) -> str:
    lines = []
    for leaf in record.leaves:
        size, shape = ("", "") if leaf.size == 1 else (f"[{leaf.size}]", " x ".join(map(str, leaf.shape)))
        note = f" /* {shape} */" if "x" in shape else ""
        lines.append(f"    {_TYPES[leaf.kind]} {leaf.name}{size};{note}")
    return "\n".join(["typedef struct {", *lines, f"}} {program.name}_{record.name};"])


def _signature(program: Program) -> str:
    types = {record.leaves: f"{program.name}_{record.name}" for record in reversed([*_structs(program)])}

    def given(record: Record, const: str) -> str:
        if not _is_lone(record):
            return f"{const}{types[record.leaves]} *{record.name}"
        (leaf,) = record.leaves
        pointer = "" if const and leaf.size == 1 else "*"
        return f"{const if pointer else ''}{_TYPES[leaf.kind]} {pointer}{record.name}"

    arguments = [given(record, "const ") for record in program.arguments if record.leaves]
    results = [given(record, "") for record in program.results if record.leaves]
    return f"void {program.name}({', '.join([*arguments, *results])})"


class _Printer:
    """Prints functions, and remembers which helpers they call."""

    def __init__(self, program: Program) -> None:
        self.helpers: set[str] = set()
        self._lone = {record.name for record in program.records if _is_lone(record)}
        self._by_value = {record.name for record in program.arguments if _is_lone(record) and record.leaves[0].size == 1}

    def signature(self, function: Function) -> str:
        """Return the first line of a function."""
        given = [
            f"{_TYPES[one.kind]} {one.name}" if isinstance(one, Name) else f"const {_TYPES[one.kind]} *{one.name}"
            for one in function.parameters
        ]
        written = [f"{_TYPES[one.kind]} *restrict {one.name}" for one in function.results]
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
                yield f"{space}const {_TYPES[name.kind]} {name.name} = {self.expression(value)};"
            case Allocate(buffer):
                size = "" if buffer.cell else f"[{buffer.size}]"
                yield f"{space}{_TYPES[buffer.kind]} {buffer.name}{size};"
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
                return _literal(value, kind)
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
            return f"({_TYPES[kind]}){both}" if kind in ("uint8", "uint16", "int8", "int16") else both
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
            case "square" if not real:
                return f"({given[0]} * {given[0]})"
            case "rsqrt":
                return f"(1 / sqrtf({given[0]}))"
            case "is_finite":
                return f"(isfinite({given[0]}) != 0)"
            case "integer_pow" if real:
                return self.helper("power", *given)
            case "square" | "sign" | "logistic":
                return self.helper(operation, *given)
            case "bitcast":
                return self.helper("to_bits" if real else "from_bits", *given)
            case "shift_left":
                return f"({_TYPES[kind]})({given[1]} < 32 ? (uint32_t){given[0]} << {given[1]} : 0)"
            case "shift_right_logical":
                return f"({_TYPES[kind]})({given[1]} < 32 ? (uint32_t){given[0]} >> {given[1]} : 0)"
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
            return f"(({_TYPES[kind]}){given})"
        whole = self.helper("to_uint32" if kind.startswith("u") else "to_int32", given)
        return whole if kind in ("int32", "uint32") else f"(({_TYPES[kind]}){whole})"

    def helper(self, name: str, *given: str) -> str:
        """Return the call of a helper."""
        self.helpers.add(name)
        return f"{name}({', '.join(given)})"


def _literal(value: Any, kind: str) -> str:
    if kind == "float32":
        if not np.isfinite(value):
            return "NAN" if np.isnan(value) else "INFINITY" if value > 0 else "(-INFINITY)"
        text = f"{np.float32(value)!s}f"
    elif value == np.iinfo("int32").min and kind == "int32":
        text = "INT32_MIN"
    else:
        text = f"{int(value)}{'u' if kind == 'uint32' else ''}"
    return f"({text})" if text.startswith("-") else text


def _rows(array: np.ndarray, kind: str) -> str:
    texts = [_literal(value, kind) for value in array.ravel().tolist()]
    return ",\n".join("    " + ", ".join(texts[at : at + _PER_LINE]) for at in range(0, len(texts), _PER_LINE))
