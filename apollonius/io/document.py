"""Files read so that none can do harm, whatever is in them, and written so that none is ever half there."""

import codecs
import json
import math
import os
import secrets
import tempfile
import tomllib
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from apollonius.io.errors import InvalidInput, shown

MOST_BYTES = 2**20
"""Largest file of settings, a game's or a training's [bytes]: some 20,000 lines."""
_DEEPEST = 100
"""Deepest nesting of lists and tables."""


def read_bytes(path: Path, kind: str, remedy: str, most: int = MOST_BYTES, within: Path | None = None) -> bytes:
    """Return the content of a regular file of `most` bytes at most; its kind, "a game's TOML file", is for messages.

    Raises InvalidInput for any other path, for a file that is too large, and for one that is not `within` a folder,
    wherever links and `..` lead; OSError when it cannot be read.
    """
    try:
        is_file, outside = path.is_file(), within and not path.resolve().is_relative_to(within.resolve())
    except (OSError, ValueError, RuntimeError):  # a path that cannot be, a link to itself
        is_file, outside = False, False
    if outside:
        raise InvalidInput(f"'{shown(path)}' is outside the folder '{within}', and must be {kind} in it: {remedy}.")
    if not is_file:
        raise InvalidInput(f"'{shown(path)}' is no file, and must be {kind}: {remedy}.")
    with open(path, "rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise InvalidInput(f"'{path}' has {path.stat().st_size:,} bytes, and {kind} has {most:,} at most: {remedy}.")
    return content


def write_atomically(path: Path, content: bytes, synced: bool = True) -> None:
    """Write a file, and its folder if need be, so that at every moment it is whole: the old one or the new.

    A `synced` one survives a loss of power. Raises OSError when the disk is full or read-only.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f"{path.name}.{secrets.token_hex(4)}.tmp")  # others may be writing this file too
    try:
        with open(temporary, "xb") as file:
            file.write(content)
            if synced:
                file.flush()
                os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            error.filename = str(path)  # which a full disk does not say
        raise


@contextmanager
def whole_folder(folder: Path) -> Generator[Path, None, None]:
    """Yield a folder to write to, which in the end is renamed to this new or empty one: it is whole, or not there."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", suffix=".tmp", dir=folder.parent) as beside:
        filled = Path(beside) / "folder"
        yield filled
        if folder.exists():
            folder.rmdir()
        os.replace(filled, folder)


def to_json(data: Any, indent: int | None = None, sort_keys: bool = False) -> str:
    """Return data as JSON; raises ValueError for a number that is not finite."""
    return json.dumps(data, allow_nan=False, indent=indent, sort_keys=sort_keys)


def parse_json(content: str | bytes, about: str) -> dict[str, Any]:
    """Return the object of a JSON text; raises InvalidInput when the text is no JSON object, is nested too deeply, or
    has a number that is not finite: what this is `about`, and the reason.
    """
    try:
        data = json.loads(content)
    except (ValueError, RecursionError) as error:  # also integers of thousands of digits, and what is no Unicode
        raise InvalidInput(f"{about} ({str(error) or 'nested too deeply'}).") from error
    if not isinstance(data, dict):
        raise InvalidInput(f"{about} (no JSON object).")
    _check(data, about)
    return data


def parse_toml(content: bytes, path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file, of which the path is for the message; errors as those of `parse_json`."""
    about = f"'{path}' is no TOML file; correct it"
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise InvalidInput(f"{about} (it is UTF-16: save it as UTF-8).")
    try:
        data = tomllib.loads(content.decode("utf-8-sig"))  # some editors begin a file with a mark
    except (ValueError, RecursionError) as error:
        raise InvalidInput(f"{about} ({str(error) or 'nested too deeply'}).") from error
    _check(data, f"'{path}' cannot be used; correct it")
    return data


def _check(data: Any, about: str) -> None:
    """Refuse numbers that are not finite, and nesting so deep that no recursive function could walk through it."""
    level: list[tuple[str, Any]] = [("", data)]
    for _ in range(_DEEPEST):
        inner = [found for name, outer in level for found in _named(name, outer)]
        for name, value in inner:
            if isinstance(value, float) and not math.isfinite(value):
                raise InvalidInput(f"{about} ({name} = {value} is not possible: it must be a finite number).")
        level = [(name, value) for name, value in inner if isinstance(value, dict | list)]
        if not level:
            return
    raise InvalidInput(f"{about} (nested too deeply).")


def _named(name: str, outer: dict[str, Any] | list[Any]) -> Iterator[tuple[str, Any]]:
    """Yield the values of a table or list with their dotted names."""
    for key, value in outer.items() if isinstance(outer, dict) else enumerate(outer):
        yield f"{name}.{key}" if name else str(key), value
