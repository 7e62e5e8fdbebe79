"""Apollonius learns, solves and plays pursuit-evasion games between mobile robots among obstacles.

The public names are imported when they are first used, so that `import apollonius` and `apollonius
--help` are quick.
"""


def __getattr__(name: str) -> object:
    homes = _homes()
    if name == "__all__":
        return __dir__()
    if name not in homes:
        raise AttributeError(f"module 'apollonius' has no attribute '{name}'")
    import importlib

    if name == "parallel_env":
        from apollonius.io.errors import require_extra

        require_extra("gym", f"apollonius.{name}")
    return getattr(importlib.import_module(homes[name]), name)


def __dir__() -> list[str]:
    return sorted(_homes().keys() - {"__version__"})


def _homes() -> dict[str, str]:
    """Return the module of each public name, by the lines that type checkers read."""
    import re
    from pathlib import Path

    stub = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    return {
        name: home for home, name in re.findall(r"^from (\S+) import (\w+)", stub, re.MULTILINE)
    }
