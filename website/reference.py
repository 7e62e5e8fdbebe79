"""The reference: a page for each room of the package, from its docstrings, and one for the command line's help."""

import argparse
import os
import pkgutil
from collections.abc import Iterator
from pathlib import Path

import apollonius
from apollonius.cli.main import build_parser

_NOT_FOR_CALLERS = {"reproduce", "__main__", "cli", "version"}
"""Rooms of the command, and data."""
_COLUMNS = 110
"""Letters in a line of a command's help."""


def write_reference(folder: Path) -> None:
    """Write the reference's pages as MyST sources."""
    folder.mkdir(parents=True)
    rooms: dict[str, list[str]] = {}
    for module in pkgutil.walk_packages(apollonius.__path__, "apollonius."):
        room = module.name.split(".")[1]
        if room not in _NOT_FOR_CALLERS and not any(part.startswith("_") for part in module.name.split(".")):
            rooms.setdefault(room, []).append(module.name)
    for room, modules in rooms.items():
        (folder / f"{room}.md").write_text(_room(room, modules))
    (folder / "command.md").write_text(_command_line(build_parser()))
    (folder / "index.md").write_text(_index(sorted(rooms)))


def _index(rooms: list[str]) -> str:
    """Return the front page: every public name, and the rooms."""
    names = "\n".join(
        f"| {{py:obj}}`{name} <{_home(name)}>` | {_first(getattr(apollonius, name))} |" for name in dir(apollonius)
    )
    contents = "\n".join(["```{toctree}", "command", *rooms, "```"])
    return f"""# Reference

**The names below are all that most programs need: `apollonius.make_game`, and so on.** The rooms, as they are called
[here](../architecture.md), hold the rest. [The command line](command.md) has a page of its own. All of it comes from
the docstrings of this version.

## The public names

| name | what it is |
|---|---|
{names}

## The rooms

{contents}
"""


def _home(name: str) -> str:
    """Return the full name of a public name, by which Sphinx finds it."""
    documented = getattr(apollonius, name)
    return f"{documented.__module__}.{documented.__qualname__}"


def _first(documented: object) -> str:
    """Return the first line of a docstring for a cell of a table."""
    lines = (documented.__doc__ or "").strip().splitlines()
    return lines[0].replace("|", "\\|") if lines else ""


def _room(room: str, modules: list[str]) -> str:
    sections = [f"# apollonius.{room}"]
    for name in modules:
        heading = [] if name == f"apollonius.{room}" else [f"## {name.removeprefix(f'apollonius.{room}.')}"]
        sections += ["\n".join([*heading, "", "```{eval-rst}", f".. automodule:: {name}", "```"])]
    return "\n\n".join(sections) + "\n"


def _command_line(parser: argparse.ArgumentParser) -> str:
    os.environ["COLUMNS"] = str(_COLUMNS)  # of which argparse makes its lines
    helps = [f"## {each.prog}\n\n```text\n{each.format_help()}```" for each in _parsers(parser)]
    return "\n\n".join(["# The command line", *helps]) + "\n"


def _parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    yield parser
    for action in parser._actions:  # pyright: ignore[reportPrivateUsage]
        for each in (action.choices or {}).values() if isinstance(action.choices, dict) else ():
            if isinstance(each, argparse.ArgumentParser):
                yield from _parsers(each)
