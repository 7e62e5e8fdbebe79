"""One cache: what took time to make is found again by all that it was made from.

A file is named after the digest of its key, and is whole or not there, whatever else reads, writes or is killed. One
that cannot be read is made again. In the person's own cache folder, which nobody looks after, the least recently used
files make room for new ones, compilations among themselves and tables among themselves.
"""

import os
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, Generic, TypeVar

from apollonius.document import to_json
from apollonius.errors import InvalidInput
from apollonius.version import __version__

T = TypeVar("T")
VARIABLE = "APOLLONIUS_CACHE"
"""Environment variable: `off`, or another folder than the platform's."""
LARGEST = {"compilations": 1 << 30, "tables": 4 << 30}
"""Folders of the cache, and the size [bytes] above which the least recently used files in one are deleted."""


def cache_folder(kind: str) -> Path | None:
    """Return the person's folder for one of `LARGEST`; None where the person has switched the cache off."""
    wish = os.environ.get(VARIABLE, "")
    if wish.lower() in ("off", "0", "no", "false"):
        return None
    if wish:
        return Path(wish) / kind
    from platformdirs import user_cache_path

    return user_cache_path("apollonius") / kind


def kept(path: Path | None, make: Callable[[], T], save: Callable[[T, Path], None], load: Callable[[Path], T]) -> T:
    """Return what a file holds, or make it and write the file.

    Args:
        path: as `entry` names it; None keeps nothing.
        save: writes the file atomically.
        load: reads it; raises InvalidInput or OSError where that cannot be done.

    Raises:
        OSError: when the file cannot be written, unless it is in the person's cache, which is only a convenience.
    """
    if path is None:
        return make()
    bound = next((most for kind, most in LARGEST.items() if path.parent == cache_folder(kind)), None)
    if path.is_file():
        with suppress(InvalidInput, OSError):
            found = load(path)
            if bound:
                mark_used(path)
            return found
    made = make()
    with suppress(*[OSError] if bound else []):
        save(made, path)
        if bound:
            make_room(path.parent, bound)
    return made


def entry(folder: Path, name: str, key: Any) -> Path:
    """Return the file of a key.

    Args:
        name: what it is called besides, with its suffix: `a.json` for `a-0123456789abcdef.json`.
        key: all that the result depends on but the version of this package, as JSON-like data.
    """
    stem, dot, suffix = name.replace("/", "-").replace(":", "-").rpartition(".")
    return folder / f"{stem}-{digest([__version__, key])[:16]}{dot}{suffix}"


def digest(data: Any) -> str:
    """Return the SHA-256 of JSON-like data."""
    return sha256(to_json(data, sort_keys=True).encode()).hexdigest()


def content(tree: Any) -> str:
    """Return the SHA-256 of a pytree: of its structure with all that is static, and of its arrays."""
    import jax
    import numpy as np

    leaves, structure = jax.tree.flatten(tree)
    found = sha256(str(structure).encode())
    for leaf in map(np.asarray, leaves):
        found.update(f"{leaf.dtype}{leaf.shape}".encode() + leaf.tobytes())
    return found.hexdigest()


def mark_used(path: Path) -> None:
    """Let others be deleted before a file of the cache, where that can be written."""
    with suppress(OSError):
        os.utime(path)


def make_room(folder: Path, largest: int) -> int:
    """Delete files, at any depth, until no more than so many bytes are left: what is larger, then the least recently
    used. Returns the bytes that are left.
    """
    files: list[tuple[bool, float, int, Path]] = []
    for path in folder.rglob("*"):
        try:
            about = path.stat()
        except FileNotFoundError:  # another process was quicker
            continue
        if path.is_file():
            files.append((about.st_size <= largest, about.st_mtime, about.st_size, path))
    left = sum(size for _, _, size, _ in files)
    for _, _, size, path in sorted(files):
        if left <= largest:
            break
        path.unlink(missing_ok=True)
        left -= size
    return left


class Memory(Generic[T]):
    """The latest results of one computation, by the content of what they were made from.

    Args:
        most: how many are remembered.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._results: dict[str, T] = {}

    def get(self, key: Any, make: Callable[[], T]) -> T:
        """Return the result for a pytree, made now unless it is remembered."""
        name = content(key)
        result = self._results[name] = self._results.pop(name) if name in self._results else make()
        while len(self._results) > self._most:
            del self._results[next(iter(self._results))]
        return result
