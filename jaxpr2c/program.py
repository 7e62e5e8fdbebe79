"""A program in C99: a header with a struct for each argument, and a source that needs the C library
only.

It allocates nothing and keeps no state. Compiled by the standard (`-std=c99`), products and sums
are rounded one by one, as in Python.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxpr2c.record import Record
from jaxpr2c.scalars import HELPERS, TYPES, number

_EXACT = (
    "#if defined __FAST_MATH__ || (defined __FINITE_MATH_ONLY__ && __FINITE_MATH_ONLY__)\n"
    '#error "compile without -Ofast, -ffast-math and -ffinite-math-only, '
    'which take NaN and infinity for impossible"\n'
    "#endif"
)
_PER_LINE = 8
_WORD = re.compile(r"\b[A-Za-z_]\w*(?:->\w+)?")


def c_names(text: str) -> frozenset[str]:
    """Return the names in a text in C."""
    return frozenset(_WORD.findall(text))


@dataclass(frozen=True)
class Program:
    """A translated function, which reads its arguments and writes its results; its public names
    begin with its own.

    Attributes:
        name: The name of its function in C, and of its files.
        functions: The functions that it calls, in C, each after those that it calls itself.
        body: Its statements in C, in braces.
        constants: The arrays that it closes over, with their names.
        arguments: The layout of each argument in memory.
        results: The layout of each result in memory.
    """

    name: str
    functions: tuple[str, ...]
    body: str
    constants: tuple[tuple[str, np.ndarray], ...]
    arguments: tuple[Record, ...]
    results: tuple[Record, ...]

    @property
    def records(self) -> tuple[Record, ...]:
        """The arguments and the results that have any array in them."""
        return tuple(record for record in (*self.arguments, *self.results) if record.leaves)

    def files(self) -> dict[str, str]:
        """Return the texts of the header and the source by their names."""
        return {f"{self.name}.h": self.header(), f"{self.name}.c": self.source()}

    def header(self, about: Sequence[str] = ()) -> str:
        """Return the header: lines `about` the program as a comment, the structs and the
        function.
        """
        guard = f"{self.name}_H"
        opening = '#ifdef __cplusplus\nextern "C" {\n#endif'
        closing = "#ifdef __cplusplus\n}\n#endif"
        blocks = [f"#ifndef {guard}\n#define {guard}", "#include <stdint.h>", opening]
        blocks += [_EXACT, *map(self._struct, self._structs())]
        blocks += [f"{self._signature()};", closing, "#endif"]
        about_lines = [f"   {line}".rstrip() for line in about]
        comment = ["\n".join(["/*", *about_lines, "*/"])] if about else []
        return "\n\n".join([*comment, *blocks]) + "\n"

    def source(self) -> str:
        """Return the source, which includes the header."""
        names = c_names(self.body)
        ignored = [
            f"    (void){record.name};"
            for record in self.records
            if names.isdisjoint(map(record.text, record.leaves))
        ]
        opening_brace, *lines = self.body.splitlines()
        entry = "\n".join([self._signature(), opening_brace, *ignored, *lines])
        bodies = [*self.functions, entry]
        constants = [
            f"static const {TYPES[str(array.dtype)]} {name}[{array.size}] = {{\n{_rows(array)}\n}};"
            for name, array in self.constants
        ]
        called_names = frozenset[str]().union(*map(c_names, bodies))
        helpers = [text for name, text in HELPERS.items() if f"op_{name}" in called_names]
        preamble = f'#include "{self.name}.h"\n\n#include <math.h>'
        return "\n\n".join([preamble, *helpers, *constants, *bodies]) + "\n"

    def _structs(self) -> Iterator[Record]:
        """The records that are structs, each layout once."""
        layouts = set()
        for record in self.records:
            if not record.is_array and record.leaves not in layouts:
                layouts.add(record.leaves)
                yield record

    def _struct(self, record: Record) -> str:
        lines: list[str] = []
        for leaf in record.leaves:
            size = "" if leaf.size == 1 else f"[{leaf.size}]"
            shape = "" if leaf.size == 1 else " x ".join(map(str, leaf.shape))
            note = f" /* {shape} */" if "x" in shape else ""
            lines.append(f"    {TYPES[leaf.kind]} {leaf.name}{size};{note}")
        return "\n".join(["typedef struct {", *lines, f"}} {self.name}_{record.name};"])

    def _signature(self) -> str:
        types = {
            record.leaves: f"{self.name}_{record.name}" for record in reversed([*self._structs()])
        }

        def parameter(record: Record, const: str) -> str:
            if not record.is_array:
                return f"{const}{types[record.leaves]} *{record.name}"
            (leaf,) = record.leaves
            pointer = "" if const and leaf.size == 1 else "*"
            return f"{const if pointer else ''}{TYPES[leaf.kind]} {pointer}{record.name}"

        arguments = [parameter(record, "const ") for record in self.arguments if record.leaves]
        results = [parameter(record, "") for record in self.results if record.leaves]
        return f"void {self.name}({', '.join([*arguments, *results])})"


def _rows(array: np.ndarray) -> str:
    kind = str(array.dtype)

    def text(element: Any) -> str:
        is_finite_float = kind == "float32" and np.isfinite(element)
        return f"{element!s}f" if is_finite_float else number(element.item(), kind)

    texts = [text(element) for element in array.ravel()]
    rows = [texts[start : start + _PER_LINE] for start in range(0, len(texts), _PER_LINE)]
    return ",\n".join("    " + ", ".join(row) for row in rows)
