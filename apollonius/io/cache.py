"""One cache: a file is named after the digest of everything it depends on.

Each folder of the user's cache has a bound, above which the least recently used files are deleted.
"""

import functools
import os
import platform
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, Generic, TypeVar

from apollonius.io.document import to_json
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
                        # JAX leaves it to the file system to note when an entry was read
                        max(file_status.st_mtime, file_status.st_atime),
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
_JAX_FOLDER = "jax_compilation_cache_dir"
"""JAX's setting for the folder of its compilations."""


def keep_compilations() -> None:
    """Let JAX store its compilations and look there first; to be called before the process
    compiles.

    Does nothing where the user has switched the cache off or set a folder for JAX, or where the
    folder cannot be written.
    """
    cache = cache_folder("compilations")
    if cache is None:
        return
    import jax

    if getattr(jax.config, _JAX_FOLDER) is not None:
        return
    # JAX tells programs, settings and its own versions apart, but not processors.
    folder = cache / sha256(processor().encode()).hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return
    if not os.access(folder, os.W_OK):
        return
    make_room(cache, LARGEST["compilations"])
    jax.config.update(_JAX_FOLDER, str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def environment() -> str:
    """Name all that a compilation depends on besides the program."""
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
