"""JAX functions as programs in C99, which need no JAX: translated, compiled, and compared with JAX.

The public names are imported when they are first used.
"""


def __getattr__(name: str) -> object:
    homes = _homes()
    if name == "__all__":
        return __dir__()
    if name not in homes:
        raise AttributeError(f"module 'jaxpr2c' has no attribute '{name}'")
    import importlib

    return getattr(importlib.import_module(homes[name]), name)


def __dir__() -> list[str]:
    return sorted(_homes())


def _homes() -> dict[str, str]:
    """Return the module of each public name, by the lines that type checkers read."""
    import re
    from pathlib import Path

    stub = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    return {
        name: home for home, name in re.findall(r"^from (\S+) import (\w+)", stub, re.MULTILINE)
    }
