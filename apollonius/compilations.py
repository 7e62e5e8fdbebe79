"""Compilations that outlive the process that made them, so that a command which ran before starts at once.

JAX finds a compilation by what is compiled; here is where the entries lie and how they are written. They are kept for
each version of JAX and of this package, and for each kind of processor: what one compiled is never run by another.
"""

import functools
import platform
import zlib
from hashlib import sha256
from pathlib import Path

from apollonius.cache import LARGEST, cache_folder, make_room, mark_used
from apollonius.document import write_atomically
from apollonius.version import __version__

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
    cache = cache_folder("compilations")
    if cache is None:
        return
    import jax

    if jax.config.values["jax_compilation_cache_dir"] is not None:
        return
    try:
        # The only way in. JAX's own store of bounded size takes a lock and 4 ms to read an entry among 1,500 (here 0.1)
        # and 56 to write one (0.3), and after a kill in between it serves half an entry and never writes again.
        from jax._src import compilation_cache

        assert callable(compilation_cache.get_file_cache)
        folder = cache / environment()
        folder.mkdir(parents=True, exist_ok=True)
    except (ImportError, AttributeError, OSError):  # another JAX, or no room
        return
    compilation_cache.get_file_cache = lambda path: (Entries(Path(path)), path)
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


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


class Entries:
    """The entries of one environment, as JAX asks for them; those of others, beside it, share the bound.

    Args:
        folder: where they lie.
        largest: size of all [bytes].
    """

    def __init__(self, folder: Path, largest: int = LARGEST["compilations"]) -> None:
        self._path = folder
        self._largest = largest
        self._size = largest  # not known yet

    def get(self, key: str) -> bytes | None:
        path = self._path / key
        try:
            found = path.read_bytes()
            mark_used(path)
        except OSError:
            return None
        checksum, value = found[:_CHECKSUM_BYTES], found[_CHECKSUM_BYTES:]
        return value if checksum == _checksum(value) else None

    def put(self, key: str, value: bytes) -> None:
        """Keep an entry; where there is no room on the disk, don't."""
        try:
            write_atomically(self._path / key, _checksum(value) + value, synced=False)
            self._size += len(value)
            if self._size > self._largest:
                self._size = make_room(self._path.parent, self._largest)
        except OSError:
            return


def _checksum(value: bytes) -> bytes:
    return zlib.crc32(value).to_bytes(_CHECKSUM_BYTES, "big")
