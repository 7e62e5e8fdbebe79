"""A program in C99: a header with a struct for each argument, and a source that needs the C library
only.

It allocates nothing and keeps no state. Compiled by the standard (`-std=c99`), products and sums
are rounded one by one, as in Python.
"""

import ctypes
import re
import shutil
import subprocess
import tempfile
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np

from apollonius.export.record import Record
from apollonius.export.scalars import HELPERS, TYPES, number
from apollonius.io.errors import InvalidInput

FLAGS = ("-std=c99", "-O2")
"""Flags of the C compiler for a source."""
_LONGEST = 600.0
"""Seconds of a compilation, after which the compiler is taken to hang."""
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

    Of the functions that it calls, in C, each is after those that it calls itself. Constants are
    the arrays that it closes over, with their names.
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


def header(program: Program, about: Sequence[str] = ()) -> str:
    """Return the header: lines that say what it is, the structs and the function."""
    guard = f"{program.name}_H"
    opening = '#ifdef __cplusplus\nextern "C" {\n#endif'
    closing = "#ifdef __cplusplus\n}\n#endif"
    blocks = [f"#ifndef {guard}\n#define {guard}", "#include <stdint.h>", opening]
    blocks += [_EXACT, *(_struct(program, record) for record in _structs(program))]
    blocks += [f"{_signature(program)};", closing, "#endif"]
    about_lines = [f"   {line}".rstrip() for line in about]
    comment = ["\n".join(["/*", *about_lines, "*/"])] if about else []
    return "\n\n".join([*comment, *blocks]) + "\n"


def source(program: Program) -> str:
    """Return the source, which includes the header."""
    names = c_names(program.body)
    ignored = [
        f"    (void){record.name};"
        for record in program.records
        if names.isdisjoint(map(record.text, record.leaves))
    ]
    opening_brace, *lines = program.body.splitlines()
    bodies = [*program.functions, "\n".join([_signature(program), opening_brace, *ignored, *lines])]
    constants = [
        f"static const {TYPES[str(array.dtype)]} {name}[{array.size}] = {{\n{_rows(array)}\n}};"
        for name, array in program.constants
    ]
    called_names = frozenset[str]().union(*map(c_names, bodies))
    helpers = [text for name, text in HELPERS.items() if f"op_{name}" in called_names]
    preamble = f'#include "{program.name}.h"\n\n#include <math.h>'
    return "\n\n".join([preamble, *helpers, *constants, *bodies]) + "\n"


def files(program: Program) -> dict[str, str]:
    """Return the texts of the header and the source by their names."""
    return {f"{program.name}.h": header(program), f"{program.name}.c": source(program)}


def _structs(program: Program) -> Iterator[Record]:
    """The records that are structs, each layout once."""
    layouts = set()
    for record in program.records:
        if not record.lone and record.leaves not in layouts:
            layouts.add(record.leaves)
            yield record


def _struct(program: Program, record: Record) -> str:
    lines = []
    for leaf in record.leaves:
        size = "" if leaf.size == 1 else f"[{leaf.size}]"
        shape = "" if leaf.size == 1 else " x ".join(map(str, leaf.shape))
        note = f" /* {shape} */" if "x" in shape else ""
        lines.append(f"    {TYPES[leaf.kind]} {leaf.name}{size};{note}")
    return "\n".join(["typedef struct {", *lines, f"}} {program.name}_{record.name};"])


def _signature(program: Program) -> str:
    types = {
        record.leaves: f"{program.name}_{record.name}" for record in reversed([*_structs(program)])
    }

    def parameter(record: Record, const: str) -> str:
        if not record.lone:
            return f"{const}{types[record.leaves]} *{record.name}"
        (leaf,) = record.leaves
        pointer = "" if const and leaf.size == 1 else "*"
        return f"{const if pointer else ''}{TYPES[leaf.kind]} {pointer}{record.name}"

    arguments = [parameter(record, "const ") for record in program.arguments if record.leaves]
    results = [parameter(record, "") for record in program.results if record.leaves]
    return f"void {program.name}({', '.join([*arguments, *results])})"


def _rows(array: np.ndarray) -> str:
    kind = str(array.dtype)

    def text(element: Any) -> str:
        is_finite_float = kind == "float32" and np.isfinite(element)
        return f"{element!s}f" if is_finite_float else number(element.item(), kind)

    texts = [text(element) for element in array.ravel()]
    rows = [texts[start : start + _PER_LINE] for start in range(0, len(texts), _PER_LINE)]
    return ",\n".join("    " + ", ".join(row) for row in rows)


@contextmanager
def compile_texts(
    texts: Mapping[str, str], compiler: str, command: Sequence[str]
) -> Generator[Path]:
    """Give the file that a compiler makes of texts by name; raises InvalidInput with its first
    error if it fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        program, log = Path(folder, "program"), Path(folder, "log")
        for name, text in texts.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        words = [*command, "-o", str(program)]
        try:
            # no pipe, which processes of a compiler that hangs would keep open
            with log.open("wb") as errors:
                result = subprocess.run(
                    words,
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=errors,
                    stderr=errors,
                    timeout=_LONGEST,
                    check=False,
                )
        except (OSError, subprocess.TimeoutExpired) as reason:
            raise InvalidInput(
                f"{compiler} does not work here ({reason}): reinstall it."
            ) from reason
        if result.returncode or not program.exists():
            output = log.read_text(encoding="utf-8", errors="replace")
            lines = output.splitlines() or [f"exit status {result.returncode}"]
            error = next((line for line in lines if "error" in line), lines[-1])
            raise InvalidInput(f"{compiler} fails ({error}): reinstall it.")
        yield program


def has_compiler() -> bool:
    """Check whether a program can be compiled here."""
    return shutil.which("gcc") is not None


class CompiledProgram:
    """A program in memory, by gcc. Its last arguments and results stay in place, so that a call can
    be timed alone.
    """

    def __init__(self, program: Program, flags: Sequence[str] = FLAGS) -> None:
        command = ["gcc", *flags, "-shared", "-fPIC", f"{program.name}.c", "-lm"]
        with compile_texts(files(program), "gcc", command) as library:
            try:
                self._function = getattr(ctypes.CDLL(str(library)), program.name)
            except OSError as reason:
                raise InvalidInput(f"what gcc compiled cannot be loaded: {reason}.") from reason
        self._program = program
        self._packed: dict[int, tuple[Any, Any]] = {}
        sizes = [record.layout.itemsize for record in program.results if record.leaves]
        self._results = [ctypes.create_string_buffer(size) for size in sizes]

    def __call__(self, *arguments: Any) -> list[np.ndarray]:
        """Return the arrays of the results, in the order of their records."""
        self._given = [
            self._pack(place, record, argument)
            for place, (record, argument) in enumerate(
                zip(self._program.arguments, arguments, strict=True)
            )
            if record.leaves
        ]
        self.rerun()
        records = [record for record in self._program.results if record.leaves]
        blocks = zip(records, self._results, strict=True)
        return [array for record, block in blocks for array in record.unpack(block.raw)]

    def rerun(self) -> None:
        """Call it once more with the arguments that it was given last."""
        self._function(*self._given, *self._results)

    def _pack(self, place: int, record: Record, argument: Any) -> Any:
        """An argument as C takes it; one that is the very object of the last call is kept."""
        last_argument, packed = self._packed.get(place, (None, None))
        if last_argument is not argument or last_argument is None:
            if record.lone and record.leaves[0].size == 1:
                number_in_c = np.ctypeslib.as_ctypes_type(np.dtype(record.leaves[0].kind))
                packed = number_in_c(np.asarray(jax.tree.leaves(argument)[0]).item())
            else:
                packed = ctypes.create_string_buffer(record.pack(argument), record.layout.itemsize)
            self._packed[place] = argument, packed
        return packed
