"""Compiled functions that a later process neither traces nor lowers.

JAX finds a compilation by its program, which each process has to trace, and that can take longer
than the call. Here it is found by the sources, JAX's settings, and the arguments: their types and
all that is static. Only what surrounds the compilation is stored; the compilation itself is JAX's
entry in the same cache.
"""

import functools
import os
import pickle
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any, Generic, TypeVar

import equinox as eqx
import jax
from jax.core import Tracer
from jax.experimental import serialize_executable as stored

from apollonius.io.cache import Entries, compiled_entries

R = TypeVar("R")
_SOURCES = Path(__file__).parents[1]
_KNOWN = {"apollonius", "builtins", "collections", "equinox", "functools", "jax", "jaxlib", "numpy"}
"""Packages whose sources, or versions, the name of an entry contains."""


class PersistentJit(Generic[R]):
    """A function under `jax.jit`, without keywords; kept on one CPU where `keep_compilations` was
    called.
    """

    def __init__(self, function: Callable[..., R]) -> None:
        functools.update_wrapper(self, function)
        self.name = f"{function.__module__}.{function.__qualname__}"
        self._jitted: Any = jax.jit(function)
        self.executables: dict[Any, Callable[..., Any]] = {}

    def __call__(self, *args: Any) -> R:
        leaves, structure = jax.tree.flatten(args)
        is_one_cpu = jax.default_backend() == "cpu" and jax.device_count() == 1
        entries = (
            compiled_entries() if is_one_cpu and not jax.config.values["jax_disable_jit"] else None
        )
        if entries is None or any(isinstance(leaf, Tracer) for leaf in leaves):
            return self._jitted(*args)
        key = structure, tuple(map(jax.typeof, leaves))
        if key not in self.executables:
            self.executables[key] = self._find(entries, args, *key)
        return self.executables[key](*args)

    def _cache_size(self) -> int:
        return len(self.executables) + self._jitted._cache_size()

    def _find(
        self, entries: Entries, args: Any, structure: Any, types: tuple[Any, ...]
    ) -> Callable[..., Any]:
        settings = (
            sorted(jax.config.values.items()),
            os.environ.get("XLA_FLAGS"),
            eqx.__version__,
            _sources(),
        )
        call_identity = repr((self.name, types, settings)).encode()
        try:
            static = BytesIO()
            _Static(static).dump(jax.tree.unflatten(structure, range(len(types))))
            name = f"kept_{self.name}-{sha256(call_identity + static.getvalue()).hexdigest()}"
        # of a function without a name, or another's class
        except (pickle.PicklingError, AttributeError, TypeError):
            return self._jitted
        # JAX promises nothing of its insides, and a compilation may have been deleted.
        with suppress(Exception):
            stored_call = entries.get(name)
            if stored_call:
                return _load(stored_call, entries, structure)
        lowered = self._jitted.lower(*args)
        entries.latest.key = None  # it stays None where this process has compiled the same before
        compilation = lowered.compile()
        with suppress(Exception):
            entries.put(name, _dump(compilation, entries.latest.key))
        return compilation


class _Static(pickle.Pickler):
    """Refuses what is of neither these sources nor a package of a known version."""

    def reducer_override(self, obj: Any) -> Any:
        if (getattr(obj, "__module__", None) or "").split(".")[0] not in _KNOWN:
            raise pickle.PicklingError(str(obj))
        return NotImplemented


_ExecutablePicklerBase: Any = getattr(stored, "_JaxPjrtPickler", pickle.Pickler)
_ExecutableUnpicklerBase: Any = getattr(stored, "_JaxPjrtUnpickler", pickle.Unpickler)


class _ExecutablePickler(_ExecutablePicklerBase):
    """Writes the name of a compilation that JAX has stored instead of its content."""

    entry: str

    def persistent_id(self, obj: Any) -> Any:
        is_compilation = hasattr(obj, "serialize") or type(obj).__name__ == "LoadedExecutable"
        return ("exec", self.entry) if is_compilation else super().persistent_id(obj)


class _ExecutableUnpickler(_ExecutableUnpicklerBase):
    """Reads the compilation that is named."""

    entries: Entries

    def persistent_load(self, pid: Any) -> Any:
        if pid[0] == "exec":
            from jax._src import compilation_cache

            data = compilation_cache.decompress_executable(self.entries.get(pid[1]) or b"")
            pid = "exec", compilation_cache.extract_executable_and_time(data)[0]
        return super().persistent_load(pid)


def _dump(compilation: Any, entry: str | None) -> bytes:
    """Serialise a compiled function without its compilation, which is JAX's entry of this name."""
    assert entry
    assert not compilation._params.const_args, "they would have to be handed over"
    file = BytesIO()
    pickler = _ExecutablePickler(file)
    pickler.entry = entry
    types = jax.tree.leaves(compilation.args_info)
    output_structure = compilation.out_tree.unflatten(range(compilation.out_tree.num_leaves))
    unloaded = compilation._executable._unloaded_executable
    pickler.dump((unloaded, types, compilation._no_kwargs, output_structure))
    return file.getvalue()


def _load(data: bytes, entries: Entries, structure: Any) -> Callable[..., Any]:
    reader = _ExecutableUnpickler(BytesIO(data), jax.devices()[0].client)
    reader.entries = entries
    unloaded, types, no_kwargs, output_structure = reader.load()
    arguments = jax.tree.unflatten(structure, types)
    info = jax.tree.unflatten(jax.tree.structure((arguments, {})), types)
    outputs = jax.tree.structure(output_structure)
    return jax.stages.Compiled(unloaded.load(), [], info, outputs, no_kwargs=no_kwargs)


@functools.cache
def _sources() -> str:
    """Return the digest of the package's files."""
    return sha256(
        b"".join(path.read_bytes() for path in sorted(_SOURCES.rglob("*.py")))
    ).hexdigest()
