"""Compilations that outlive the process that made them, so that a command which ran before starts at once.

JAX finds a compilation by what is compiled; here is where the entries lie and how they are written. They are kept for
each version of JAX and of this package, and for each kind of processor: what one compiled is never run by another.
"""

import functools
import os
import platform
import tempfile
import zlib
from hashlib import sha256
from pathlib import Path
from typing import Any

from apollonius.version import __version__

VARIABLE = "APOLLONIUS_CACHE"
"""Environment variable: `off`, or another folder than the platform's."""
LARGEST = 1 << 30
"""Size [bytes] above which the entries that nobody has used for longest are deleted."""
_CHECKSUM_BYTES = 4
_TOLD_BY = {
    "vendor_id", "cpu family", "model", "flags", "CPU implementer", "CPU architecture", "CPU variant", "CPU part",
    "Features",
}  # fmt: skip
"""The lines of `/proc/cpuinfo` that say what a processor can do."""


def keep_compilations() -> None:
    """From here on, JAX keeps what it compiles and looks there first; for this process, before it has compiled.

    Does nothing where the person has switched it off, has told JAX of a folder of their own, or has no folder that can
    be written to.
    """
    cache = cache_folder()
    if cache is None:
        return
    import jax

    if jax.config.values["jax_compilation_cache_dir"] is not None:
        return
    try:
        # The only way in: the store that JAX ships may leave half an entry behind, and then never mends it.
        from jax._src import compilation_cache

        assert callable(compilation_cache.get_file_cache)
        folder = cache / environment()
        folder.mkdir(parents=True, exist_ok=True)
    except (ImportError, AttributeError, OSError):  # another JAX, or no room
        return
    compilation_cache.get_file_cache = lambda path: (_kept_in(Path(path)), path)
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def cache_folder() -> Path | None:
    """Where what was computed is kept from one call to the next; None where the person has switched that off."""
    wish = os.environ.get(VARIABLE, "")
    if wish.lower() in ("off", "0", "no", "false"):
        return None
    return Path(wish) if wish else default_folder()


def default_folder() -> Path:
    """Where a person's compilations lie on this platform."""
    from platformdirs import user_cache_path

    return user_cache_path("apollonius") / "compilations"


def environment() -> str:
    """All that a compilation depends on besides what is compiled: a folder's name."""
    from importlib.metadata import version

    made_with = "-".join([__version__, *(version(package) for package in ("jax", "jaxlib"))])
    return f"{made_with}-{sha256(processor().encode()).hexdigest()[:12]}"


@functools.cache
def processor() -> str:
    """What the processor can do, in the system's words; where the system does not say, this machine's name."""
    try:
        first = Path("/proc/cpuinfo").read_text().split("\n\n")[0].splitlines()
    except OSError:
        first = []
    told = [line for line in first if line.split(":")[0].strip() in _TOLD_BY]
    return "\n".join([platform.system(), platform.machine(), *(told or [platform.processor(), platform.node()])])


class Store:
    """Entries in files, each whole or not there, whoever else reads and writes; together of bounded size.

    Args:
        folder: of the entries of one environment; those of others, beside it, share the bound.
        largest: the bound [bytes].
    """

    def __init__(self, folder: Path, largest: int = LARGEST) -> None:
        self.folder = folder
        self.largest = largest
        self._size = -1  # not known yet

    def get(self, key: str) -> bytes | None:
        """The entry, or None where there is none that is whole."""
        path = self.folder / key
        try:
            content = path.read_bytes()
            os.utime(path)  # used just now, so that others are deleted before it
        except OSError:
            return None
        checksum, value = content[:_CHECKSUM_BYTES], content[_CHECKSUM_BYTES:]
        return value if checksum == _checksum(value) else None

    def put(self, key: str, value: bytes) -> None:
        """Keep an entry; where there is no room on the disk, don't."""
        if len(value) > self.largest:
            return
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=self.folder, prefix=".", delete=False) as file:
                file.write(_checksum(value) + value)
            os.replace(file.name, self.folder / key)
            self._make_room(len(value))
        except OSError:
            return

    def _make_room(self, added: int) -> None:
        """Delete what was not used for longest, where all entries together have grown too large."""
        if 0 <= self._size <= self.largest - added:
            self._size += added
            return
        entries = []
        for path in self.folder.parent.glob("*/*"):
            try:
                entries.append((path.stat().st_mtime, path.stat().st_size, path))
            except FileNotFoundError:  # another process was quicker
                continue
        self._size = sum(size for _, size, _ in entries)
        for _, size, path in sorted(entries):
            if self._size <= self.largest:
                break
            path.unlink(missing_ok=True)
            self._size -= size


def _checksum(value: bytes) -> bytes:
    return zlib.crc32(value).to_bytes(_CHECKSUM_BYTES, "big")


def _kept_in(folder: Path) -> Any:
    """The store, as JAX wants it."""
    from jax._src.compilation_cache_interface import CacheInterface

    class Kept(CacheInterface):
        _path = folder
        _store = Store(folder)

        def get(self, key: str) -> Any:
            return self._store.get(key)

        def put(self, key: str, value: bytes) -> None:
            self._store.put(key, value)

    return Kept()
