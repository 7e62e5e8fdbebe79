"""A program in C, compiled on this machine and called from Python: to check and to time it."""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from apollonius.export.c import header, source
from apollonius.export.program import Program
from apollonius.export.record import Record
from apollonius.io.errors import InvalidInput

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-O2")
"""How a source is compiled."""
_BY_VALUE = {"float32": ctypes.c_float, "int32": ctypes.c_int32, "uint32": ctypes.c_uint32, "bool": ctypes.c_uint8}


class Compiled:
    """A program in memory. Its last arguments and results stay in place, so that a call can be timed alone.

    Raises:
        InvalidInput: where there is no gcc.
        subprocess.CalledProcessError: where it complains.
    """

    def __init__(self, program: Program, flags: Sequence[str] = FLAGS) -> None:
        if shutil.which("gcc") is None:
            raise InvalidInput("a program in C cannot be checked here: there is no gcc.")
        with tempfile.TemporaryDirectory() as folder:
            library = Path(folder) / "program.so"
            Path(folder, f"{program.name}.h").write_text(header(program))
            Path(folder, f"{program.name}.c").write_text(source(program))
            words = ["gcc", *flags, "-shared", "-fPIC", f"{program.name}.c", "-lm", "-o", str(library)]
            subprocess.run(words, check=True, cwd=folder)
            self._function = getattr(ctypes.CDLL(str(library)), program.name)
        self._program = program
        self._packed: dict[int, tuple[Any, Any]] = {}
        self._results = [ctypes.create_string_buffer(max(one.length, 1)) for one in program.results if one.leaves]

    def __call__(self, *arguments: Any) -> list[np.ndarray]:
        """Return the arrays of the results, in the order of their records."""
        self._given = [
            self._pack(place, record, argument)
            for place, (record, argument) in enumerate(zip(self._program.arguments, arguments, strict=True))
            if record.leaves
        ]
        self.again()
        records = [record for record in self._program.results if record.leaves]
        both = zip(records, self._results, strict=True)
        return [array for record, block in both for array in record.unpack(block.raw)]

    def again(self) -> None:
        """Call it once more with the arguments that it was given last."""
        self._function(*self._given, *self._results)

    def _pack(self, place: int, record: Record, argument: Any) -> Any:
        """An argument as C takes it; one that is the very object of the last call is kept."""
        known, packed = self._packed.get(place, (None, None))
        if known is not argument or known is None:
            if record.lone and record.leaves[0].size == 1:
                packed = _BY_VALUE[record.leaves[0].kind](np.asarray(jax.tree.leaves(argument)[0]).item())
            else:
                packed = ctypes.create_string_buffer(record.pack(argument), max(record.length, 1))
            self._packed[place] = argument, packed
        return packed
