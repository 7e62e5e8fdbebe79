"""The compilation that is under way in this process, for those who wait for it."""

import functools
import threading
import time

_LOWERED, _COMPILED = "/jax/core/compile/jaxpr_to_mlir_module_duration", "/jax/core/compile/backend_compile_duration"
"""What JAX records when XLA begins to compile a program, and when that is over."""
_begun: dict[int, float] = {}
"""When each thread that compiles began to."""


@functools.cache
def watch_compilations() -> None:
    """Let JAX, which this imports, tell of each compilation from now on."""
    from jax import monitoring

    monitoring.register_event_duration_secs_listener(_record)


def _record(event: str, duration_secs: float, **kwargs: str | int) -> None:
    if event == _LOWERED:
        _begun[threading.get_ident()] = time.monotonic()
    elif event == _COMPILED:
        _begun.pop(threading.get_ident(), None)


def compiling_seconds() -> float:
    """Return the age of the oldest compilation that is under way [s]; 0 without one."""
    return max((time.monotonic() - begun for begun in list(_begun.values())), default=0.0)
