"""The page's programs as WebAssembly: `make page` compiles them, and a test compares their
sources.
"""

import base64
import json
import sys
from collections.abc import Iterable
from typing import Any

from apollonius.web.programs import (
    OF_PAGE,
    compile_programs,
    page_programs,
    sources,
    sources_digest,
)
from apollonius.web.site import PAGE
from jaxpr2c.program import Program
from jaxpr2c.record import Record

COMPILED = PAGE / "compiled.js"


def _layouts(programs: Iterable[Program]) -> dict[str, Any]:
    """Return the layout of arguments in memory, the longest of each name, and the arguments and
    results of functions.

    A record has a length and leaves, each with its kind, size and offset; a number has no place in
    memory.
    """

    def layout(record: Record) -> tuple[int, list[Any]]:
        leaf_offsets = zip(record.leaves, record.offsets, strict=True)
        return record.layout.itemsize, [
            [leaf.name, leaf.kind, leaf.size, offset] for leaf, offset in leaf_offsets
        ]

    arguments: dict[str, tuple[int, list[Any]]] = {}
    functions: dict[str, Any] = {}
    for program in programs:
        for record in program.arguments:
            if not record.is_array or record.leaves[0].size > 1:
                arguments[record.name] = max(arguments.get(record.name, (0, [])), layout(record))
        results = {record.name: layout(record) for record in program.results}
        functions[program.name] = [[record.name for record in program.arguments], results]
    return {"given": arguments, "functions": functions}


def main() -> None:
    """Write the file; with `--check`, fail if it is outdated."""
    programs = [*page_programs()]
    source_line = (
        f'export const SOURCE = "{sources_digest(sources(programs))}"; // SHA-256 of all C '
        "sources\n"
    )
    if "--check" in sys.argv:
        current = source_line in COMPILED.read_text(encoding="utf-8")
        sys.exit(None if current else "the page's programs are outdated: run `make page`")
    layouts = json.dumps(_layouts(programs), separators=(",", ":"))
    module = base64.b64encode(compile_programs(programs, OF_PAGE)).decode()
    COMPILED.write_text(
        f"// Made by `make page` from `apollonius/web/programs.py`.\n\n{source_line}"
        f'export const LAYOUTS = {layouts};\nexport const MODULE = "{module}";\n',
        encoding="utf-8",
    )
    print(f"{COMPILED}: {COMPILED.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
