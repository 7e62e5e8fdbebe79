"""The rooms of the packages: `python -m website.house` prints them with the arrows between them."""

import ast
import graphlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).parents[1]
PACKAGE = "apollonius"
"""The package that has rooms."""
TRANSLATOR = "jaxpr2c"
"""The package beside it, which is one room."""


@dataclass(frozen=True)
class Room:
    """A folder of the package, a file that lies beside the folders, or the package beside it."""

    purpose: str
    """The first line of its docstring."""
    imports: frozenset[str]
    """The other rooms that its files import, without those that these import themselves."""


def sources() -> dict[str, str]:
    """Return the text of every module by its full name; a stub belongs to its module."""
    texts: dict[str, str] = {}
    folders = [REPOSITORY / name for name in (PACKAGE, TRANSLATOR)]
    paths = [
        path
        for suffix in ("py", "pyi")
        for folder in folders
        for path in folder.rglob(f"*.{suffix}")
    ]
    for path in paths:
        name = ".".join(path.relative_to(REPOSITORY).with_suffix("").parts)
        name = name.removesuffix(".__init__")
        texts[name] = texts.get(name, "") + path.read_text(encoding="utf-8")
    return texts


def room_of(module: str) -> str:
    """Return the room of a module: `apollonius.game.arena` is in `game`."""
    package, *inside = module.split(".")
    return inside[0] if package == PACKAGE and inside else package


def imported(tree: ast.AST, modules: Collection[str]) -> set[str]:
    """Return the full names of all that the statements of a module import, which are absolute
    ones.
    """
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        if isinstance(node, ast.ImportFrom):
            assert node.module, "imports have whole names"
            names |= {f"{node.module}.{alias.name}" for alias in node.names} & set(modules) or {
                node.module
            }
    return names


def rooms(texts: Mapping[str, str]) -> dict[str, Room]:
    """Return all rooms, each below those that it imports. Raises graphlib.CycleError where arrows
    go in a circle.
    """
    arrows: dict[str, set[str]] = {}
    for module, text in texts.items():
        names = {
            name
            for name in imported(ast.parse(text), texts)
            if name.split(".")[0] in (PACKAGE, TRANSLATOR)
        }
        own_room = room_of(module)
        arrows.setdefault(own_room, set()).update({room_of(name) for name in names} - {own_room})
    behind: dict[str, set[str]] = {}
    for name in graphlib.TopologicalSorter(arrows).static_order():
        behind[name] = arrows[name].union(
            *(behind[imported_room] for imported_room in arrows[name])
        )
    all_rooms: dict[str, Room] = {}
    for name in sorted(behind, key=lambda name: (len(behind[name]), name)):
        first = texts.get(f"{PACKAGE}.{name}", texts.get(name, ""))
        direct = frozenset(
            imported_room
            for imported_room in arrows[name]
            if not any(imported_room in behind[between] for between in arrows[name])
        )
        all_rooms[name] = Room(
            (ast.get_docstring(ast.parse(first)) or "").partition("\n")[0], direct
        )
    return all_rooms


def table(all_rooms: Mapping[str, Room]) -> str:
    """Return the rooms as a table in Markdown."""
    rows = [
        f"| `{name}` | {', '.join(sorted(room.imports))} | {room.purpose} |"
        for name, room in all_rooms.items()
    ]
    return "\n".join(["| room | imports | what it is |", "|---|---|---|", *rows])


if __name__ == "__main__":
    print(table(rooms(sources())))
