"""Modules of JavaScript as one script, for a page that has no files beside it to import."""

import re
from pathlib import Path

_IMPORT = re.compile(r'^import \{([^}]+)\} from "([^"]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?:const|class|function\*?) (\w+)", re.MULTILINE)
_COMMENT = re.compile(r"^ *(?://[^\n]*|/\*\*.*?\*/)\n", re.MULTILINE | re.DOTALL)


def bundled(entry: Path) -> str:
    """A module with all that it imports before it, each as an object of what it exports; comments are left out.

    Args:
        entry: the module's file; its imports name files relative to it, and form no circle.
    """
    objects: dict[Path, str] = {}

    def imported(path: Path) -> str:
        """The module's text, with its imports taken from objects."""
        text = re.sub(_COMMENT, "", path.read_text())
        return _IMPORT.sub(lambda found: _taken(found[1], obtained(path.parent / found[2])), text)

    def obtained(path: Path) -> str:
        """The name of a module's object, which is put before those that ask for it."""
        name = f"{path.stem}Module"
        if path.resolve() not in objects:
            text = imported(path)
            exports = ", ".join(_EXPORT.findall(text))
            inner = re.sub("^export ", "", text, flags=re.MULTILINE)
            objects[path.resolve()] = f"const {name} = (() => {{\n{inner}return {{ {exports} }};\n}})();\n"
        return name

    text = imported(entry)
    return "".join(objects.values()) + text


def _taken(names: str, module: str) -> str:
    return f"const {{{names.replace(' as ', ': ')}}} = {module};\n"
