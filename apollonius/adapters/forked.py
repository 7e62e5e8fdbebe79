"""Forked processes: the threads of JAX are missing there, and its next computation would wait for them for ever."""

import os

from apollonius.errors import InvalidInput

_forked: list[bool] = []
os.register_at_fork(after_in_child=lambda: _forked.append(True))


def require_unforked() -> None:
    """Refuse to compute in a process that was forked after this module was imported.

    Raises:
        InvalidInput: there, with the remedy.
    """
    if _forked:
        raise InvalidInput(
            "JAX cannot compute in a forked process: start it by spawning, as "
            "gymnasium.vector.AsyncVectorEnv does with context='spawn', or take gymnasium.make_vec."
        )
