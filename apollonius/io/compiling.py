"""The compilation that is under way in this process, for those who wait for it."""

import functools
import threading
import time

_LOWERED = "/jax/core/compile/jaxpr_to_mlir_module_duration"
"""JAX's event when XLA begins to compile a program."""
_COMPILED = "/jax/core/compile/backend_compile_duration"
"""JAX's event when it has compiled it."""
_begun: dict[int, float] = {}
"""Start of the compilation of each thread that compiles [s]."""


@functools.cache
def watch_compilations() -> None:
    """Import JAX, and record its compilations from now on."""
    from jax import monitoring

    monitoring.register_event_duration_secs_listener(_record)


def _record(event: str, duration_secs: float, **kwargs: str | int) -> None:
    if event == _LOWERED:
        _begun[threading.get_ident()] = time.monotonic()
    elif event == _COMPILED:
        _begun.pop(threading.get_ident(), None)


def compiling_seconds() -> float:
    """Return the age of the oldest compilation that is under way [s]; 0 without one."""
    return max((time.monotonic() - start for start in list(_begun.values())), default=0.0)
