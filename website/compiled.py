"""What the page runs, as WebAssembly: `make page` compiles it, and a test compares the source that it was made from."""

import base64
import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import apollonius.show
from apollonius.export.c import Program, header, source
from apollonius.export.record import Record
from apollonius.web.programs import page_programs
from apollonius.web.site import PAGE

COMPILED = PAGE / "compiled.js"
IN_REPORTS = Path(apollonius.show.__file__).with_name("compiled.js")
"""What reports have in place of it, with what draws a game and no more."""
_OF_REPORTS = ("step", "move", "clearance", "clearance_along", "room_after", "places")
_STACK = 2**20
"""For the arrays of functions [bytes]; a hidden layer has 32 KB."""
_FLAGS = (
    "-target", "wasm32-wasi", "-mexec-model=reactor", "-std=c99", "-O2", "-msimd128", "-s",
    f"-Wl,-z,stack-size={_STACK},--export=__heap_base",
)  # fmt: skip


def sources(programs: Iterable[Program]) -> dict[str, str]:
    """Return the C files of all programs by their names."""
    return {
        name: text
        for one in programs
        for name, text in ((f"{one.name}.h", header(one)), (f"{one.name}.c", source(one)))
    }


def digest(files: dict[str, str]) -> str:
    """Return the SHA-256 of C files."""
    return hashlib.sha256("".join(f"{name}\n{text}" for name, text in files.items()).encode()).hexdigest()


def _layouts(programs: Iterable[Program]) -> dict[str, Any]:
    """Return how arguments lie in memory, the longest of each name, and what each function takes and returns.

    Of a record there are its length and its leaves, each with its kind, size and offset.
    """

    def layout(record: Record) -> tuple[int, list[Any]]:
        return record.length, [[leaf.name, leaf.kind, leaf.size, leaf.offset] for leaf in record.leaves]

    given: dict[str, tuple[int, list[Any]]] = {}
    functions: dict[str, Any] = {}
    for program in programs:
        for record in program.arguments:
            given[record.name] = max(given.get(record.name, (0, [])), layout(record))
        results = {record.name: layout(record) for record in program.results}
        functions[program.name] = [[record.name for record in program.arguments], results]
    return {"given": given, "functions": functions}


def compiled(files: dict[str, str], names: Iterable[str]) -> bytes:
    """Return the module with these C files and functions."""
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            Path(folder, name).write_text(text)
        exports = [f"-Wl,--export={name}" for name in names]
        units = [name for name in files if name.endswith(".c")]
        command = [sys.executable, "-m", "ziglang", "cc", *_FLAGS, *exports, "-o", "programs.wasm", *units, "-lm"]
        subprocess.run(command, cwd=folder, check=True)
        return Path(folder, "programs.wasm").read_bytes()


def _text(programs: Sequence[Program], made_of: str) -> str:
    """Return the JavaScript that holds some programs."""
    module = compiled(sources(programs), [program.name for program in programs])
    layouts = json.dumps(_layouts(programs), separators=(",", ":"))
    return (
        f"// Made by `make page` from `apollonius/web/programs.py`.\n\n{made_of}"
        f'export const LAYOUTS = {layouts};\nexport const MODULE = "{base64.b64encode(module).decode()}";\n'
    )


def main() -> None:
    """Write the files of the page and of reports; with `--check`, say whether they are what they would be now."""
    programs = [*page_programs()]
    made_of = f'export const SOURCE = "{digest(sources(programs))}"; // SHA-256 of all C sources\n'
    files = {COMPILED: programs, IN_REPORTS: [program for program in programs if program.name in _OF_REPORTS]}
    if "--check" in sys.argv:
        current = all(made_of in path.read_text() for path in files)
        sys.exit(None if current else "the page's programs are outdated: run `make page`")
    for path, some in files.items():
        path.write_text(_text(some, made_of))
        print(f"{path}: {path.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
