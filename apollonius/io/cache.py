"""One cache: a file is named after the digest of everything it depends on, and is whole or absent.

Each folder of the user's cache has a bound, above which the least recently used files are deleted.
"""

import functools
import os
import platform
import threading
import zlib
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, Generic, TypeVar

from apollonius.io.document import to_json, write_atomically
from apollonius.io.errors import InvalidInput
from apollonius.version import __version__

T = TypeVar("T")
VARIABLE = "APOLLONIUS_CACHE"
"""Environment variable: `off`, or another folder than the platform's."""
LARGEST = {"compilations": 1 << 30, "tables": 4 << 30}
"""Folders of the cache, and the size [bytes] above which the least recently used files in one are
deleted.
"""


def cache_folder(kind: str) -> Path | None:
    """Return the user's folder for one of `LARGEST`; None where the user has switched the cache
    off.
    """
    wish = os.environ.get(VARIABLE, "")
    if wish.lower() in ("off", "0", "no", "false"):
        return None
    if wish:
        return Path(wish) / kind
    from platformdirs import user_cache_path

    return user_cache_path("apollonius") / kind


def cached(
    path: Path | None,
    make: Callable[[], T],
    save: Callable[[T, Path], None],
    load: Callable[[Path], T],
) -> T:
    """Load a value from its file, or make it and write the file.

    Args:
        path: The file; None makes the value without a file.
        make: Makes the value.
        save: Writes the value to a file.
        load: Reads it; a file that it refuses, by InvalidInput or OSError, is made again.

    Raises:
        OSError: If the file cannot be written, unless it is in the user's cache.
    """
    if path is None:
        return make()
    bounds = (most for kind, most in LARGEST.items() if path.parent == cache_folder(kind))
    bound = next(bounds, None)
    if path.is_file():
        with suppress(InvalidInput, OSError):
            value = load(path)
            if bound:
                _mark_used(path)
            return value
    value = make()
    with suppress(*[OSError] if bound else []):
        save(value, path)
        if bound:
            make_room(path.parent, bound)
    return value


def entry_path(folder: Path, name: str, key: Any) -> Path:
    """Name the file of a value that depends on this version and a key, as
    `a-0123456789abcdef.json`.
    """
    stem, dot, suffix = name.replace("/", "-").replace(":", "-").rpartition(".")
    return folder / f"{stem}-{digest([__version__, key])[:16]}{dot}{suffix}"


def digest(data: Any) -> str:
    """Return the SHA-256 of JSON-like data."""
    return sha256(to_json(data, sort_keys=True).encode()).hexdigest()


def content(tree: Any) -> str:
    """Return the SHA-256 of a pytree's structure, with its static parts, and of its arrays."""
    import jax
    import numpy as np

    leaves, structure = jax.tree.flatten(tree)
    hasher = sha256(str(structure).encode())
    for leaf in map(np.asarray, leaves):
        hasher.update(f"{leaf.dtype}{leaf.shape}".encode() + leaf.tobytes())
    return hasher.hexdigest()


def _mark_used(path: Path) -> None:
    with suppress(OSError):
        os.utime(path)


def make_room(folder: Path, largest: int) -> int:
    """Delete files below a folder until at most `largest` bytes remain; return their number.

    Files larger than the bound are first, then the least recently used ones.
    """
    files: list[tuple[bool, float, int, Path]] = []
    for path in folder.rglob("*"):
        with suppress(FileNotFoundError):  # another process was quicker
            file_status = path.stat()
            if path.is_file():
                files.append(
                    (
                        file_status.st_size <= largest,
                        file_status.st_mtime,
                        file_status.st_size,
                        path,
                    )
                )
    size_left = sum(size for _, _, size, _ in files)
    for _, _, size, path in sorted(files):
        if size_left <= largest:
            break
        path.unlink(missing_ok=True)
        size_left -= size
    return size_left


class Memory(Generic[T]):
    """The `most` latest results of one computation, by the content of its arguments."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._results: dict[str, T] = {}

    def get(self, key: Any, make: Callable[[], T]) -> T:
        """Return the result for a pytree, computed unless it is remembered."""
        name = content(key)
        result = self._results[name] = self._results.pop(name) if name in self._results else make()
        while len(self._results) > self._most:
            del self._results[next(iter(self._results))]
        return result


_kept: "Entries | None" = None
_CHECKSUM_BYTES = 4
_CAPABILITIES = {
    "vendor_id",
    "cpu family",
    "model",
    "flags",
    "CPU implementer",
    "CPU architecture",
    "CPU variant",
    "CPU part",
    "Features",
}
"""The lines of `/proc/cpuinfo` that say what a processor can do."""


def keep_compilations() -> None:
    """Let JAX store its compilations and look there first; to be called before the process
    compiles.

    Does nothing where the user has switched the cache off or set a folder for JAX, or where no
    folder can be written.
    """
    cache = cache_folder("compilations")
    if cache is None:
        return
    import jax

    if jax.config.values["jax_compilation_cache_dir"] is not None:
        return
    try:
        # JAX has no other way to set a store. Its own of bounded size takes a lock and 4 ms to read
        # one of 1,500 entries (this one 0.1) and 56 ms to write one (0.3); after a kill in between
        # it serves half an entry and never writes again.
        from jax._src import compilation_cache

        assert callable(compilation_cache.get_file_cache)
        folder = cache / environment()
        folder.mkdir(parents=True, exist_ok=True)
    except (ImportError, AttributeError, OSError):  # another JAX, or no room
        return
    global _kept
    _kept = entries = Entries(folder)
    compilation_cache.get_file_cache = lambda path: (entries, path)
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def compiled_entries() -> "Entries | None":
    """Return the compilations that this process keeps; None where it keeps none of its own."""
    return _kept


def environment() -> str:
    """Return the name of the folder for all that a compilation depends on besides the program."""
    from importlib.metadata import version

    versions = "-".join([__version__, *(version(package) for package in ("jax", "jaxlib"))])
    return f"{versions}-{sha256(processor().encode()).hexdigest()[:12]}"


@functools.cache
def processor() -> str:
    """Return the processor's capabilities as the system names them, or else this machine's name."""
    try:
        first_lines = (
            Path("/proc/cpuinfo").read_text(encoding="utf-8").split("\n\n")[0].splitlines()
        )
    except OSError:
        first_lines = []
    capability_lines = [line for line in first_lines if line.split(":")[0].strip() in _CAPABILITIES]
    return "\n".join(
        [
            platform.system(),
            platform.machine(),
            *(capability_lines or [platform.processor(), platform.node()]),
        ]
    )


class Entries:
    """The compilations of one environment, with the methods that JAX calls; `largest` bounds those
    of all [bytes].
    """

    def __init__(self, folder: Path, largest: int = LARGEST["compilations"]) -> None:
        self._path = folder
        self._largest = largest
        self._size = largest  # not known yet
        self.latest = threading.local()  # its `key` is the last that a thread has asked for

    def get(self, key: str) -> bytes | None:
        self.latest.key = key
        path = self._path / key
        try:
            data = path.read_bytes()
            _mark_used(path)
        except OSError:
            return None
        checksum = data[:_CHECKSUM_BYTES]
        value = data[_CHECKSUM_BYTES:]
        return value if checksum == _checksum(value) else None

    def put(self, key: str, value: bytes) -> None:
        """Write an entry unless the disk is full."""
        with suppress(OSError):
            write_atomically(self._path / key, _checksum(value) + value, synced=False)
            self._size += len(value)
            if self._size > self._largest:
                self._size = make_room(self._path.parent, self._largest)


def _checksum(value: bytes) -> bytes:
    return zlib.crc32(value).to_bytes(_CHECKSUM_BYTES, "big")
