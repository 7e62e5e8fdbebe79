"""How a command ends that has written something: what, how much, and what to do next."""

import argparse
import shlex
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from apollonius.replay import Replay

_SHOWN = 3
"""Files that are named one by one; of more, the folder and the first."""


def finish(*written: Path, then: str = "", json: bool = False) -> None:
    """Say on standard error what was written and what could be done with it.

    Args:
        written: files, or folders with all that lies in them.
        then: the next sensible step.
        json: whether a program reads: it is not told what to do next.
    """
    lines = [f"wrote {_named(path)}" for path in written]
    if len(written) > _SHOWN:
        size = _in_words(sum(map(_size, written)))
        lines = [f"wrote {len(written)} files in {written[0].parent} ({size}), first of all {written[0].name}"]
    if then and not json:
        lines.append(f"next: {then}")
    print(*lines, sep="\n", file=sys.stderr, flush=True)


def write_replays(options: argparse.Namespace, kind: str, replays: "Iterator[Replay]") -> list[Path]:
    """Write the first `options.record` games, in files that are called after their kind, number and outcome."""
    from apollonius.replay import save_replay

    if options.record:
        options.display.begin(f"writing {options.record} replays")
    written = []
    for replay in islice(replays, options.record):
        written.append(options.replays / f"{kind}-{replay.index}-{replay.outcome.name.lower()}.json")
        save_replay(replay, written[-1])
    return written


def finish_with_replays(written: list[Path], options: argparse.Namespace) -> None:
    """The end of a command that may have recorded games, and takes `--json`."""
    if written:
        then = command("show", written[0], "--out", written[0].with_suffix(".gif"))
        finish(*written, then=then, json=options.json)


def command(*words: object) -> str:
    """A command of this package, as it can be pasted into a shell."""
    return shlex.join(["apollonius", *map(str, words)])


def _named(path: Path) -> str:
    if not path.is_dir():
        return f"{path} ({_in_words(_size(path))})"
    count = sum(file.is_file() for file in path.rglob("*"))
    return f"{path} ({count} file{'' if count == 1 else 's'}, {_in_words(_size(path))})"


def _size(path: Path) -> int:
    """Bytes of a file, or of all files in a folder."""
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file())


def _in_words(size: int) -> str:
    """Bytes, in the unit that keeps the number short."""
    if size < 10**6:
        return f"{size / 1000:.0f} kB" if size >= 1000 else f"{size} bytes"
    return f"{size / 10**6:.1f} MB"
