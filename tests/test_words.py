"""Docstrings are plain English: a function's begins with a verb, and none has the words below.

`python tests/test_words.py ROOM` lists what is to be rewritten in a room, or in all of them.
"""

import ast
import re
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]
PACKAGE = REPOSITORY / "apollonius"
ROOMS = {"apollonius": sorted(PACKAGE.glob("*.py"))} | {
    folder.name: sorted(folder.rglob("*.py"))
    for folder in sorted([*PACKAGE.iterdir(), *(REPOSITORY / name for name in ("benchmarks", "examples", "website"))])
    if any(folder.glob("*.py"))
}
"""The files of each room."""
OPENING = re.compile(r"(What|How|Whether|Whom?|Whose|Where|Which|Those|The same)\b|(It|They|This|These) \w+\.")
WORDS = re.compile(
    r"\b(anew|whoever|of them|so many|is none|goes on|that there (is|are)|told|announced|gears?|seats?|sitting)\b", re.I
)


def offences(path):
    """Yield each docstring, attributes' too, that opens with a wrong word or contains one."""
    for node in ast.walk(ast.parse(path.read_text())):
        body = getattr(node, "body", [])
        of_function = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        for line in body if isinstance(body, list) else ():
            match line:
                case ast.Expr(value=ast.Constant(value=str(text))):
                    text = " ".join(text.split())
                    if wrong := (of_function and OPENING.match(text)) or WORDS.search(text):
                        yield f"{path.relative_to(REPOSITORY)}:{line.lineno}: '{wrong[0]}' in: {text[:100]}"


@pytest.mark.parametrize("room", ROOMS)
def test_docstrings_are_plain_english(room):
    assert [wrong for path in ROOMS[room] for wrong in offences(path)] == []


if __name__ == "__main__":
    print(*(wrong for room in sys.argv[1:] or ROOMS for path in ROOMS[room] for wrong in offences(path)), sep="\n")
