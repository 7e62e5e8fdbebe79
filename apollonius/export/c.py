"""A program in C99: a header with a struct for each argument, and a source that needs the C library only.

It allocates nothing and keeps no state. Compiled by the standard (`-std=c99`), products and sums are rounded one
by one, as in Python.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from apollonius.export.c_printer import HELPERS, TYPES, Printer, literal
from apollonius.export.program import Buffer, Program
from apollonius.export.record import Record
from apollonius.export.sweep import parts

_PER_LINE = 8


def header(program: Program, about: Sequence[str] = ()) -> str:
    """Return the header: lines that say what it is, the structs and the function."""
    guard = f"{program.name.upper()}_H"
    opening, closing = '#ifdef __cplusplus\nextern "C" {\n#endif', "#ifdef __cplusplus\n}\n#endif"
    blocks = [f"#ifndef {guard}\n#define {guard}", "#include <stdint.h>", opening]
    blocks += [
        *(_struct(program, record) for record in _structs(program)),
        f"{_signature(program)};",
        closing,
        "#endif",
    ]
    said = ["\n".join(["/*", *(f"   {line}".rstrip() for line in about), "*/"])] if about else []
    return "\n\n".join([*said, *blocks]) + "\n"


def source(program: Program) -> str:
    """Return the source, which includes the header."""
    printer = Printer(program)
    *functions, entry = program.functions
    bodies = [f"{printer.signature(function)}\n{printer.block(function.body)}" for function in functions]
    used = {part.leaf[0] for part in parts(entry.body) if isinstance(part, Buffer) and part.leaf}
    ignored = [f"    (void){record.name};" for record in program.records if record.name not in used]
    opened, *lines = printer.block(entry.body).splitlines()
    bodies.append("\n".join([_signature(program), opened, *ignored, *lines]))
    constants = [
        f"static const {TYPES[buffer.kind]} {buffer.name}[{buffer.size}] = {{\n{_rows(array, buffer.kind)}\n}};"
        for buffer, array in program.constants
    ]
    helpers = [text for name, text in HELPERS.items() if name in printer.helpers]
    opening = f'#include "{program.name}.h"\n\n#include <math.h>'
    return "\n\n".join([opening, *helpers, *constants, *bodies]) + "\n"


def _structs(program: Program) -> Iterator[Record]:
    """The records that are structs, each layout once."""
    seen = set()
    for record in program.records:
        if not record.lone and record.leaves not in seen:
            seen.add(record.leaves)
            yield record


def _struct(program: Program, record: Record) -> str:
    lines = []
    for leaf in record.leaves:
        size, shape = ("", "") if leaf.size == 1 else (f"[{leaf.size}]", " x ".join(map(str, leaf.shape)))
        note = f" /* {shape} */" if "x" in shape else ""
        lines.append(f"    {TYPES[leaf.kind]} {leaf.name}{size};{note}")
    return "\n".join(["typedef struct {", *lines, f"}} {program.name}_{record.name};"])


def _signature(program: Program) -> str:
    types = {record.leaves: f"{program.name}_{record.name}" for record in reversed([*_structs(program)])}

    def given(record: Record, const: str) -> str:
        if not record.lone:
            return f"{const}{types[record.leaves]} *{record.name}"
        (leaf,) = record.leaves
        pointer = "" if const and leaf.size == 1 else "*"
        return f"{const if pointer else ''}{TYPES[leaf.kind]} {pointer}{record.name}"

    arguments = [given(record, "const ") for record in program.arguments if record.leaves]
    results = [given(record, "") for record in program.results if record.leaves]
    return f"void {program.name}({', '.join([*arguments, *results])})"


def _rows(array: np.ndarray, kind: str) -> str:
    texts = [literal(value, kind) for value in array.ravel().tolist()]
    return ",\n".join("    " + ", ".join(texts[at : at + _PER_LINE]) for at in range(0, len(texts), _PER_LINE))
