"""Generated pages: the command line, the configuration, and the Python API from its docstrings."""

import argparse
import inspect
import os
import pkgutil
import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, get_args

from sphinx.pycode import ModuleAnalyzer  # pyright: ignore[reportMissingImports]

import apollonius
import jaxpr2c
from apollonius.cli.main import build_parser
from apollonius.game.chart import Chart
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.scenario import Scenario
from apollonius.learn.config import RunConfig
from website.house import room_of

_NOT_FOR_CALLERS = {"reproduce", "__main__", "cli", "version"}
"""Rooms of the command, and data."""
_COLUMNS = 110
"""Letters in a line of a command's help."""
_WITHOUT_TABLES = (Chart, OccupancyMap, Scenario)
"""Records that a training's `config.toml` names, or leaves out."""


def write_reference(folder: Path) -> None:
    """Write the reference's pages as MyST sources."""
    api = folder / "api"
    api.mkdir(parents=True)
    rooms: dict[str, list[str]] = {}
    for package in (apollonius, jaxpr2c):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            room = room_of(module.name)
            if room not in _NOT_FOR_CALLERS and not any(
                part.startswith("_") for part in module.name.split(".")
            ):
                rooms.setdefault(room, []).append(module.name)
    for room, modules in rooms.items():
        (api / f"{room}.md").write_text(_room(room, modules), encoding="utf-8")
    (folder / "command.md").write_text(_command_line(build_parser()), encoding="utf-8")
    (folder / "config.md").write_text(_config(), encoding="utf-8")
    (api / "index.md").write_text(_index(sorted(rooms)), encoding="utf-8")


def _index(rooms: list[str]) -> str:
    """Return the front page: every public name, and the rooms."""
    names, names_of_translator = map(_summary, (apollonius, jaxpr2c))
    contents = "\n".join(["```{toctree}", *rooms, "```"])
    return f"""# Python API

Most programs need only these names: `apollonius.make_game`, and so on. The modules, described in
[Architecture](../../concepts/architecture.md), hold the rest.

## The public names

{names}

## The public names of the translator

`jaxpr2c` is [a package beside it](../../jaxpr2c.md), of the same wheel.

{names_of_translator}

## Modules

{contents}
"""


def _summary(package: ModuleType) -> str:
    """Return a table of the public names of a package."""
    public = [getattr(package, name) for name in dir(package)]
    names = [f"   ~{documented.__module__}.{documented.__qualname__}" for documented in public]
    return "\n".join(["```{eval-rst}", ".. autosummary::", "   :nosignatures:", "", *names, "```"])


def _room(room: str, modules: list[str]) -> str:
    title = room if room == "jaxpr2c" else f"apollonius.{room}"
    sections = [f"# {title}"]
    for name in modules:
        heading = [] if name == title else [f"## {name.removeprefix(f'{title}.')}"]
        sections += ["\n".join([*heading, "", "```{eval-rst}", f".. automodule:: {name}", "```"])]
    return "\n\n".join(sections) + "\n"


def _config() -> str:
    """Return a table for each record of a training's `config.toml`: key, default and the field's
    docstring.
    """
    about = "A run saves all of these; a `--config` file may leave out what keeps its default."
    first = dict[type, str]()
    for name, record in _records(RunConfig):
        first.setdefault(record, name)
    return (
        "\n\n".join(
            ["# Configuration", about, *(_keys(name, record) for record, name in first.items())]
        )
        + "\n"
    )


def _records(record: Any, name: str = "") -> Iterator[tuple[str, type]]:
    """Yield the tables of a record and of those in it, with their names."""
    yield name, record
    for key in fields(record):
        for inner in (key.type, *get_args(key.type)):
            if is_dataclass(inner) and inner not in _WITHOUT_TABLES:
                yield from _records(inner, f"{name}.{key.name}".removeprefix("."))


def _keys(name: str, record: type) -> str:
    """Return the keys of one table, with the defaults that are plain values."""
    meaning: dict[str, str] = {}
    for base in reversed(record.__mro__):
        meaning |= _documented(base) if base.__module__.startswith("apollonius.") else {}
    rows: list[str] = []
    for key in fields(record):
        default = f"`{key.default}`" if isinstance(key.default, bool | int | float | str) else ""
        rows += [f"| `{key.name}` | {default} | {meaning.get(key.name, '')} |"]
    heading = f"## {f'[{name}]' if name else 'Top level'}"
    return "\n".join([heading, "", "| key | default | meaning |", "|---|---|---|", *rows])


def _documented(record: type) -> dict[str, str]:
    """Collect the attributes of a class's docstring, and the docstrings below its fields."""
    attributes = (inspect.getdoc(record) or "").partition("Attributes:\n")[2].partition("\n\n")[0]
    entries = re.findall(r"^ {4}(\w[\w, ]*): (.*(?:\n {5,}.*)*)", attributes, re.MULTILINE)
    meanings = {
        name: " ".join(text.split()) for names, text in entries for name in names.split(", ")
    }
    below = ModuleAnalyzer.for_module(record.__module__).find_attr_docs()
    meanings |= {
        name: " ".join(lines) for (owner, name), lines in below.items() if owner == record.__name__
    }
    return {name: text.replace("|", "\\|") for name, text in meanings.items()}


def _command_line(parser: argparse.ArgumentParser) -> str:
    os.environ["COLUMNS"] = str(_COLUMNS)  # of which argparse makes its lines
    helps = [
        f"## {command_parser.prog}\n\n```text\n{command_parser.format_help()}```"
        for command_parser in _parsers(parser)
    ]
    return "\n\n".join(["# The command line", *helps]) + "\n"


def _parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    yield parser
    for action in parser._actions:  # pyright: ignore[reportPrivateUsage]
        if isinstance(action, argparse._SubParsersAction):  # pyright: ignore[reportPrivateUsage]
            for subparser in action.choices.values():
                yield from _parsers(subparser)
