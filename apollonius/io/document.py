"""Reading files safely, whatever is in them, and writing files atomically."""

import codecs
import json
import math
import os
import secrets
import tempfile
import tomllib
from collections import Counter
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from apollonius.io.errors import InvalidInput, format_value

MOST_BYTES = 2**20
"""Largest file of settings, a game's or a training's [bytes]: some 20,000 lines."""
_DEEPEST = 100
"""Deepest nesting of lists and tables."""


def read_bytes(
    path: Path, kind: str, remedy: str, most: int = MOST_BYTES, within: Path | None = None
) -> bytes:
    """Read a regular file.

    Args:
        path: The file.
        kind: Its kind for messages, as "a game's TOML file".
        remedy: What to do about a wrong path, for messages.
        most: Its largest size [bytes].
        within: Folder that must contain it, wherever links and `..` lead.

    Raises:
        InvalidInput: For any other path, a larger file, and one outside of `within`.
        OSError: If it cannot be read.
    """
    try:
        is_file = path.is_file()
        is_outside = within and not path.resolve().is_relative_to(within.resolve())
    except (OSError, ValueError, RuntimeError):  # an impossible path, a link to itself
        is_file = False
        is_outside = False
    if is_outside:
        bound = f"is outside the folder '{within}', and must be {kind} in it"
        raise InvalidInput(f"'{format_value(path)}' {bound}: {remedy}.")
    if not is_file:
        raise InvalidInput(f"'{format_value(path)}' is no file, and must be {kind}: {remedy}.")
    with open(path, "rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        sizes = f"{path.stat().st_size:,} bytes, and {kind} has {most:,} at most"
        raise InvalidInput(f"'{path}' has {sizes}: {remedy}.")
    return content


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file, and its folder if need be, so that it is always whole, even after a loss of
    power: the old one or the new one.

    Raises OSError when the disk is full or read-only.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # others may be writing this file too
    temporary = path.with_name(f"{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        with open(temporary, "xb") as file:
            file.write(content)
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
    """Yield a temporary folder to write to, which is renamed to this new or empty one at the
    end.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(
        prefix=f".{folder.name}.", suffix=".tmp", dir=folder.parent
    ) as parent:
        temporary = Path(parent) / "folder"
        yield temporary
        if folder.exists():
            folder.rmdir()
        os.replace(temporary, folder)


def to_json(data: Any, indent: int | None = None, sort_keys: bool = False) -> str:
    """Return data as JSON; raises ValueError for a number that is not finite."""
    return json.dumps(data, allow_nan=False, indent=indent, sort_keys=sort_keys)


def parse_json(content: str | bytes, about: str) -> dict[str, Any]:
    """Parse a JSON object.

    Args:
        content: The text.
        about: Beginning of the message.

    Raises:
        InvalidInput: If the text is no JSON object, is nested too deeply, has a key twice in one
            object, or a number that is not finite.
    """
    try:
        data = json.loads(content, object_pairs_hook=_without_duplicates)
    # also integers of thousands of digits, and what is no Unicode
    except (ValueError, RecursionError) as error:
        raise InvalidInput(f"{about} ({str(error) or 'nested too deeply'}).") from error
    if not isinstance(data, dict):
        raise InvalidInput(f"{about} (no JSON object).")
    _check(data, about)
    return data


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of JSON as a dictionary; raises ValueError where a key comes twice."""
    data = dict(pairs)
    if len(data) < len(pairs):
        twice = next(key for key, count in Counter(key for key, _ in pairs).items() if count > 1)
        raise ValueError(f"'{twice}' comes twice: remove one")
    return data


def parse_toml(content: bytes, path: Path) -> dict[str, Any]:
    """Parse a TOML file, whose path is for the message; raises InvalidInput as `parse_json`."""
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
    """Refuse numbers that are not finite, and nesting too deep for a recursive function."""
    level: list[tuple[str, Any]] = [("", data)]
    for _ in range(_DEEPEST):
        inner = [item for name, outer in level for item in _named(name, outer)]
        for name, value in inner:
            if isinstance(value, float) and not math.isfinite(value):
                bound = f"{name} = {value} is not possible: it must be a finite number"
                raise InvalidInput(f"{about} ({bound}).")
        level = [(name, value) for name, value in inner if isinstance(value, dict | list)]
        if not level:
            return
    raise InvalidInput(f"{about} (nested too deeply).")


def _named(name: str, outer: dict[str, Any] | list[Any]) -> Iterator[tuple[str, Any]]:
    """Yield the values of a table or list with their dotted names."""
    for key, value in outer.items() if isinstance(outer, dict) else enumerate(outer):
        yield f"{name}.{key}" if name else str(key), value
