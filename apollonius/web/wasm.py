"""Programs as WebAssembly: those that the page runs, and a player of a user's own beside them."""

import hashlib
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path

from apollonius.agents.policy import AbstractPolicy
from apollonius.export.c import Program, files
from apollonius.io.document import write_atomically
from apollonius.io.errors import require
from apollonius.web.programs import player_program

_FLAGS = ("-target", "wasm32-wasi", "-std=c99", "-O2", "-msimd128", "-s")
_STACK = 2**24
"""For the arrays of functions [bytes]; the paths of a chart have 5 MB."""
OF_PAGE = ("-mexec-model=reactor", f"-Wl,-z,stack-size={_STACK},--export=__heap_base")
"""Flags for a module with a memory of its own."""
_OWN, _OWN_END = 2**26, 2**26 + 2**23
"""Where in the page's memory a player of a user's own has its constants and its stack, as in `programs.js` [bytes]."""
_OF_PLAYER = (
    "-mexec-model=reactor",
    f"-Wl,-z,stack-size={2**21},--import-memory,--global-base={_OWN},--initial-memory={_OWN_END}",
)


def sources(programs: Iterable[Program]) -> dict[str, str]:
    """Return the C files of all programs by their names."""
    return {name: text for one in programs for name, text in files(one).items()}


def digest(files: dict[str, str]) -> str:
    """Return the SHA-256 of C files."""
    return hashlib.sha256("".join(f"{name}\n{text}" for name, text in files.items()).encode()).hexdigest()


def compiled(programs: Sequence[Program], flags: Sequence[str]) -> bytes:
    """Return the module with some programs; raises InvalidInput where the compiler is not installed."""
    require(find_spec("ziglang") is not None, "ziglang", "missing", "installed, as it compiles: pip install ziglang")
    texts = sources(programs)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in texts.items():
            Path(folder, name).write_text(text)
        command = [sys.executable, "-m", "ziglang", "cc", *_FLAGS, *flags]
        command += [*(f"-Wl,--export={program.name}" for program in programs), "-o", "programs.wasm"]
        command += [*(name for name in texts if name.endswith(".c")), "-lm"]
        subprocess.run(command, cwd=folder, check=True)
        return Path(folder, "programs.wasm").read_bytes()


def write_player(player: AbstractPolicy, path: Path) -> None:
    """Write a player as a file that `apollonius play --against FILE` takes; raises InvalidInput for a player that the
    page cannot play, or where the compiler is not installed.
    """
    write_atomically(path, compiled([player_program(player)], _OF_PLAYER))
