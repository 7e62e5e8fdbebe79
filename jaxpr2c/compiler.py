"""Programs compiled, and called from Python: to compare and to time them."""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxpr2c.errors import CompilerFailure
from jaxpr2c.program import Program
from jaxpr2c.record import Record

FLAGS = ("-std=c99", "-O2")
"""Flags of the C compiler for a source."""
_LONGEST = 600.0
"""Seconds of a compilation, after which the compiler is taken to hang."""


@contextmanager
def compile_texts(
    texts: Mapping[str, str], compiler: str, command: Sequence[str]
) -> Generator[Path]:
    """Give the file that a compiler makes of texts by name; raises CompilerFailure with its first
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
            raise CompilerFailure(
                f"{compiler} does not work here ({reason}): reinstall it."
            ) from reason
        if result.returncode or not program.exists():
            output = log.read_text(encoding="utf-8", errors="replace")
            lines = output.splitlines() or [f"exit status {result.returncode}"]
            error = next((line for line in lines if "error" in line), lines[-1])
            raise CompilerFailure(f"{compiler} fails ({error}): reinstall it.")
        yield program


def has_compiler() -> bool:
    """Check whether a program can be compiled here."""
    return shutil.which("gcc") is not None


class CompiledProgram:
    """A program in memory, by gcc. Its last arguments and results stay in place, so that a call can
    be timed alone.

    Raises CompilerFailure where gcc is missing or fails.
    """

    def __init__(self, program: Program, flags: Sequence[str] = FLAGS) -> None:
        command = ["gcc", *flags, "-shared", "-fPIC", f"{program.name}.c", "-lm"]
        with compile_texts(program.files(), "gcc", command) as library:
            try:
                self._function = getattr(ctypes.CDLL(str(library)), program.name)
            except OSError as reason:
                raise CompilerFailure(f"what gcc compiled cannot be loaded: {reason}.") from reason
        self._program = program
        self._packed: dict[int, tuple[Any, Any]] = {}
        self._arguments = list[Any]()
        sizes = [record.layout.itemsize for record in program.results if record.leaves]
        self._results = [ctypes.create_string_buffer(size) for size in sizes]

    def __call__(self, *arguments: Any) -> list[np.ndarray]:
        """Return the arrays of the results, as `jax.tree.leaves` orders those of the function."""
        self._arguments = [
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
        """Call it once more with the arguments of the last call."""
        self._function(*self._arguments, *self._results)

    def _pack(self, place: int, record: Record, argument: Any) -> Any:
        """An argument as C takes it; one that is the very object of the last call is kept."""
        last_argument, packed = self._packed.get(place, (None, None))
        if last_argument is not argument or last_argument is None:
            if record.is_array and record.leaves[0].size == 1:
                number_in_c = np.ctypeslib.as_ctypes_type(np.dtype(record.leaves[0].kind))
                packed = number_in_c(np.asarray(jax.tree.leaves(argument)[0]).item())
            else:
                packed = ctypes.create_string_buffer(record.pack(argument), record.layout.itemsize)
            self._packed[place] = argument, packed
        return packed
