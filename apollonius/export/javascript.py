"""A program in JavaScript: a module whose function reads and writes typed arrays, rounding as single precision does.

Arrays of its own are made once, when the module is loaded; the function itself allocates nothing.
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
    Slice,
    Statement,
    Store,
    While,
    parts,
)

ARRAYS = {
    "float32": "Float32Array", "int32": "Int32Array", "uint32": "Uint32Array", "bool": "Uint8Array",
    "uint8": "Uint8Array", "uint16": "Uint16Array", "int8": "Int8Array", "int16": "Int16Array",
}
"""The typed array of each kind."""
_SIGNS = {
    "add": "+", "sub": "-", "mul": "*", "div": "/", "rem": "%", "and": "&", "or": "|", "xor": "^",
    "eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">=",
}
_LIBRARY = set("floor ceil sqrt exp expm1 log log1p sin cos tan asin acos atan sinh cosh tanh cbrt pow atan2 abs sign".split())
_TRUTHS = {"eq", "ne", "lt", "le", "gt", "ge"}
_HELPERS = {
    "largest": "const largest = (a, b) => (a !== a || a > b ? a : b);",
    "least": "const least = (a, b) => (a !== a || a < b ? a : b);",
    "square": "const square = (x) => fround(x * x);",
    "logistic": "const logistic = (x) => fround(1 / fround(1 + fround(Math.exp(-x))));",
    "round_even": """const round_even = (x) => {
    const low = Math.floor(x), over = x - low;
    return over < 0.5 || (over === 0.5 && low % 2 === 0) ? low : low + 1;
};""",
    "round_away": "const round_away = (x) => Math.sign(x) * Math.floor(Math.abs(x) + 0.5);",
    "power": """const power = (x, n) => {
    let product = 1, factor = x;
    for (let left = Math.abs(n); left > 0; left >>= 1) {
        if (left & 1)
            product = fround(product * factor);
        factor = fround(factor * factor);
    }
    return n < 0 ? fround(1 / product) : product;
};""",
    "to_int32": "const to_int32 = (x) => (x !== x ? 0 : x >= 2147483648 ? 2147483647 : x <= -2147483648 ? -2147483648 : x | 0);",
    "to_uint32": "const to_uint32 = (x) => (x !== x || x <= 0 ? 0 : x >= 4294967296 ? 4294967295 : x >>> 0);",
    "to_bits": "const to_bits = (x) => { real[0] = x; return bits[0]; };",
    "from_bits": "const from_bits = (x) => { bits[0] = x; return real[0]; };",
}
_PER_LINE = 12


def source(program: Program) -> str:
    """Return the module: it exports the function, and `records`, which says how its arguments and results lie."""
    printer = _Printer(program)
    *functions, entry = program.functions
    bodies = [printer.function(function) for function in functions]
    bodies.append(printer.entry(entry))
    constants = [
        f"const {buffer.name} = new {ARRAYS[buffer.kind]}([\n{_rows(array)}\n]);" for buffer, array in program.constants
    ]
    shared = ["const real = new Float32Array(1), bits = new Uint32Array(real.buffer);"]
    helpers = [text for name, text in _HELPERS.items() if name in printer.helpers]
    helpers = (shared if printer.helpers & {"to_bits", "from_bits"} else []) + helpers
    records = ",\n".join(_record(record.name, record) for record in program.records)
    opening = ["const fround = Math.fround;", f"export const records = {{\n{records}\n}};"]
    own = [f"const {name} = new {ARRAYS[kind]}({size});" for name, kind, size in printer.arrays]
    return "\n\n".join([*opening, *helpers, *constants, *(["\n".join(own)] if own else []), *bodies]) + "\n"


def _record(name: str, record: Any) -> str:
    leaves = [f'        ["{leaf.name}", "{leaf.kind}", {leaf.size}, {leaf.offset}]' for leaf in record.leaves]
    return "\n".join([f"    {name}: {{ bytes: {record.bytes}, leaves: [", ",\n".join(leaves), "    ] }"])


class _Printer:
    """Prints functions, and remembers which helpers they call and which arrays they have."""

    def __init__(self, program: Program) -> None:
        self.helpers: set[str] = set()
        self.arrays: list[tuple[str, str, int]] = []
        self._program = program
        self._function = ""

    def function(self, function: Function) -> str:
        """Return a function: a buffer is given with the index that it begins at."""
        self._function = function.name
        given = [
            one.name if isinstance(one, Name) else f"{one.name}, {one.name}_at"
            for one in (*function.parameters, *function.results)
        ]
        return f"function {function.name}({', '.join(given)}) {self.block(function.body)}"

    def entry(self, function: Function) -> str:
        """Return the function that is exported: each argument and each result is an object of typed arrays, or a lone one."""
        self._function = function.name
        used = {part.name: part.leaf for part in parts(function.body) if isinstance(part, Buffer) and part.leaf}
        names = [record.name for record in self._program.records]
        opened, *lines = self.block(function.body).splitlines()
        views = [f"    const {name} = {'.'.join(leaf)};" for name, leaf in used.items() if leaf[1]]
        heading = f"export function {function.name}({', '.join(names)}) {opened}"
        return "\n".join([heading, *views, *lines])

    def block(self, statements: Sequence[Statement], depth: int = 0) -> str:
        """Return statements in braces."""
        lines = [line for statement in statements for line in self.statement(statement, depth + 1)]
        return "\n".join(["{", *lines, "    " * depth + "}"])

    def statement(self, statement: Statement, depth: int) -> Iterator[str]:
        """Yield the lines of one statement."""
        space = "    " * depth
        match statement:
            case Let(name, value):
                yield f"{space}const {name.name} = {self.expression(value)};"
            case Allocate(buffer) if buffer.cell:
                yield f"{space}let {buffer.name};"
            case Allocate(buffer):
                self.arrays.append((self.array(buffer), buffer.kind, buffer.size))
            case Store(buffer, index, value):
                yield f"{space}{self.element(buffer, index)} = {self.expression(value)};"
            case Loop(counter, count, body):
                heading = f"for (let {counter.name} = 0; {counter.name} < {count}; {counter.name}++)"
                yield f"{space}{heading} {self.block(body, depth)}"
            case While(before, condition, body):
                leave = f"{space}    if (!{self.expression(condition)})\n{space}        break;"
                lines = [line for one in before for line in self.statement(one, depth + 1)]
                # What the condition needs is computed first.
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
        return f"{self.array(argument.buffer)}, {self.at(argument.buffer, argument.offset)}"

    def array(self, buffer: Buffer) -> str:
        """Return the name of an array: a function's own begin with its name, since they are made outside."""
        outside = buffer.cell or buffer.given or buffer.leaf or buffer.name.startswith("k")
        return buffer.name if outside else f"{self._function}_{buffer.name}"

    def at(self, buffer: Buffer, index: Expression) -> str:
        """Return an index, from where a given buffer begins."""
        return f"{buffer.name}_at + {self.expression(index)}" if buffer.given else self.expression(index)

    def element(self, buffer: Buffer, index: Expression) -> str:
        """Return an element of an array."""
        return buffer.name if buffer.cell else f"{self.array(buffer)}[{self.at(buffer, index)}]"

    def expression(self, expression: Expression) -> str:
        """Return an expression, in brackets where that could matter."""
        match expression:
            case Number(value, kind):
                return _literal(value)
            case Name(name, _):
                return name
            case Load(buffer, index):
                return self.element(buffer, index)
            case Apply(operation, kind, operands):
                return self.apply(operation, kind, operands[0].kind, *map(self.expression, operands))

    def apply(self, operation: str, kind: str, of: str, *given: str) -> str:
        """Return an operation on operands of the kind `of`."""
        if operation in _TRUTHS:
            return f"({given[0]} {_SIGNS[operation]} {given[1]})"
        if operation == "mul" and kind in ("int32", "uint32"):
            return _wrapped(f"Math.imul({given[0]}, {given[1]})", kind)
        if operation in _SIGNS:
            return _wrapped(f"({given[0]} {_SIGNS[operation]} {given[1]})", kind)
        match operation:
            case "select":
                return f"({given[0]} ? {given[1]} : {given[2]})"
            case "convert":
                return self.converted(kind, of, given[0])
            case "neg":
                return _wrapped(f"(-{given[0]})", kind) if kind != "float32" else f"(-{given[0]})"
            case "not":
                return f"(!{given[0]})" if kind == "bool" else _wrapped(f"(~{given[0]})", kind)
            case "max" | "min":
                return self.helper("largest" if operation == "max" else "least", *given)
            case "rsqrt":
                return f"fround(1 / fround(Math.sqrt({given[0]})))"
            case "exp2":
                return f"fround(2 ** {given[0]})"
            case "is_finite":
                return f"Number.isFinite({given[0]})"
            case "integer_pow":
                return self.helper("power", *given)
            case "square" if kind != "float32":
                return _wrapped(f"Math.imul({given[0]}, {given[0]})", kind)
            case "square" | "logistic" | "round_even" | "round_away":
                return self.helper(operation, *given)
            case "bitcast":
                return self.helper("to_bits" if of == "float32" else "from_bits", *given)
            case "shift_left":
                return _wrapped(f"({given[1]} < 32 ? {given[0]} << {given[1]} : 0)", kind)
            case "shift_right_logical":
                return _wrapped(f"({given[1]} < 32 ? {given[0]} >>> {given[1]} : 0)", kind)
            case "shift_right_arithmetic":
                return f"({given[0]} >> ({given[1]} < 31 ? {given[1]} : 31))"
            case _ if operation in _LIBRARY:
                return _wrapped(f"Math.{operation}({', '.join(given)})", kind)
            case _:
                raise NotImplementedError(f"{operation} of {of}")

    def converted(self, kind: str, of: str, given: str) -> str:
        """Return a number as one of another kind."""
        if kind == "bool":
            return f"({given} != 0)"
        if kind == "float32":
            return f"({given} ? 1 : 0)" if of == "bool" else f"fround({given})"
        if of == "bool":
            return f"({given} ? 1 : 0)"
        if of == "float32":
            return self.helper("to_uint32" if kind.startswith("u") else "to_int32", given)
        return _wrapped(given, kind)

    def helper(self, name: str, *given: str) -> str:
        """Return the call of a helper."""
        self.helpers.add(name)
        return f"{name}({', '.join(given)})"


def _wrapped(text: str, kind: str) -> str:
    """A number as its kind rounds it."""
    match kind:
        case "float32":
            return f"fround{text}" if text.startswith("(") else f"fround({text})"
        case "int32":
            return f"({text} | 0)"
        case "uint32":
            return f"({text} >>> 0)"
        case "uint8" | "uint16":
            return f"({text} & {np.iinfo(kind).max})"
        case "int8" | "int16":
            away = 32 - np.iinfo(kind).bits
            return f"({text} << {away} >> {away})"
        case _:
            return text


def _literal(value: Any) -> str:
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, float):
        if not np.isfinite(value):
            return "NaN" if np.isnan(value) else "Infinity" if value > 0 else "(-Infinity)"
        text = repr(float(np.float32(value))).removesuffix(".0")
    else:
        text = str(int(value))
    return f"({text})" if text.startswith("-") else text


def _rows(array: np.ndarray) -> str:
    texts = [_literal(value) for value in array.ravel().tolist()]
    return ",\n".join("    " + ", ".join(texts[at : at + _PER_LINE]) for at in range(0, len(texts), _PER_LINE))
