"""Files that people give, read so that none can do harm, and files written so that none is ever half there.

Before one is read its size is looked at, and no content is an error of the program's.
"""

import json
import os
import secrets
import tempfile
import tomllib
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from apollonius.errors import InvalidInput, shown

MOST_BYTES = 2**20
"""Largest file of settings, a game's or a training's [bytes]: some 20,000 lines."""
_DEEPEST = 100
"""Deepest nesting of lists and tables."""


def read_bytes(path: Path, kind: str, remedy: str, most: int = MOST_BYTES) -> bytes:
    """All that is in a file.

    Args:
        kind: what the file should be, for the message: "a game's TOML file".
        remedy: what to do instead, for the message.
        most: largest size that is read [bytes].

    Raises:
        InvalidInput: for a path of no file, and for a file that is too large.
        OSError: when it cannot be read.
    """
    try:
        size = path.stat().st_size if path.is_file() else None
    except (OSError, ValueError):  # a path that cannot be
        size = None
    if size is None:
        raise InvalidInput(f"'{shown(path)}' is no file, and must be {kind}: {remedy}.")
    if size > most:
        raise InvalidInput(f"'{path}' has {size:,} bytes, and {kind} has {most:,} at most: {remedy}.")
    return path.read_bytes()


def write_atomically(path: Path, content: bytes, synced: bool = True) -> None:
    """Write a file, in a folder that need not be there, so that at every moment it is whole: the old one or the new.

    Args:
        synced: wait for the disk, so that the content also outlives a loss of power.

    Raises:
        OSError: when the disk is full or read-only; the old content is untouched.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f"{path.name}.{secrets.token_hex(4)}.tmp")  # others may be writing this file too
    try:
        with open(temporary, "wb") as file:
            file.write(content)
            if synced:
                file.flush()
                os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


@contextmanager
def whole_folder(folder: Path) -> Generator[Path, None, None]:
    """Make a folder that is new or empty, so that everything the block writes is in it, or there is none.

    Yields:
        The folder to write to, which then takes the other's place.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", suffix=".tmp", dir=folder.parent) as beside:
        filled = Path(beside) / "folder"
        filled.mkdir()
        yield filled
        if folder.exists():
            folder.rmdir()
        os.replace(filled, folder)


def parse_json(content: str | bytes, about: str) -> dict[str, Any]:
    """The object that a JSON text is.

    Args:
        about: what it is, and what to do if it is not: the message, to which the reason is added.

    Raises:
        InvalidInput: when it is none, or is nested too deeply.
    """
    try:
        data = json.loads(content)
    except (ValueError, RecursionError) as error:  # also integers of thousands of digits, and what is no Unicode
        raise InvalidInput(f"{about} ({str(error) or 'nested too deeply'}).") from error
    if not isinstance(data, dict):
        raise InvalidInput(f"{about} (no JSON object).")
    _check_depth(data, about)
    return data


def parse_toml(content: bytes, path: Path) -> dict[str, Any]:
    """The tables of a TOML file.

    Args:
        path: where it is from, for the message.

    Raises:
        InvalidInput: when it is no TOML, or is nested too deeply.
    """
    about = f"'{path}' is no TOML file; correct it"
    try:
        data = tomllib.loads(content.decode())
    except (ValueError, RecursionError) as error:
        raise InvalidInput(f"{about} ({str(error) or 'nested too deeply'}).") from error
    _check_depth(data, about)
    return data


def _check_depth(data: Any, about: str) -> None:
    """Refuse what is nested so deeply that whoever walks through it could not."""
    level = [data]
    for _ in range(_DEEPEST):
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, dict | list)
        ]
        if not level:
            return
    raise InvalidInput(f"{about} (nested too deeply).")
