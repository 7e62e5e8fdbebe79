"""Names are nouns of the field, one for one thing; docstrings are plain English and begin with a verb.

`python tests/test_words.py ROOM` lists what is to be rewritten in a room, or in all of them.
"""

import ast
import pkgutil
import re
import sys
from collections import defaultdict
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]
PACKAGE = REPOSITORY / "apollonius"
TRANSLATOR = REPOSITORY / "jaxpr2c"
ROOMS = {"apollonius": sorted(PACKAGE.glob("*.py"))} | {
    folder.name: sorted(folder.rglob("*.py"))
    for folder in sorted(
        [*PACKAGE.iterdir(), TRANSLATOR, *(REPOSITORY / name for name in ("benchmarks", "examples", "website"))]
    )
    if any(folder.glob("*.py"))
}
"""The files of each room."""
PARTICIPLES = re.compile(
    "found|made|given|known|seen|kept|held|told|said|asked|begun|here|there|one|both|others|theirs|way"
)
"""They say neither what a value is nor what it is for."""
PRIVATE_WORDS = re.compile(r"\b(caution|bold|practice|cast|lesson|entrant|handed|holding|standing|looks|setting)\b")
"""Words that only this project used for things that have a name in the field."""
BY_ANOTHER_NAME = {
    "parse_known_args": "argparse's own",
    "main": "of each program that is started by itself",
}
"""Names that a rule below forbids, each with the reason for it."""
OPENING = re.compile(
    r"(return )?(what|how|whether|whom?|whose|where|which|those|the same)\b|(it|they|this|these) \w+\.", re.I
)
WORDS = re.compile(
    r"\b(errors as (of|those)|anew|whoever|of them|so many|is none|goes on|that there (is|are)|told|announced|gears?"
    r"|seats?|sitting)\b",
    re.I,
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


def names(path):
    """Yield the line and the name of each function, class, argument and variable of a file."""
    for node in ast.walk(ast.parse(path.read_text())):
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                yield node.lineno, name
            case ast.arg(arg=name) | ast.Name(id=name, ctx=ast.Store()):
                yield node.lineno, name


def misnomers(path):
    """Yield each name that is a participle, and each with a word that is not of the field."""
    for line, name in names(path):
        words = re.sub("([A-Z])|_", r" \1", name).lower()
        is_defect = PARTICIPLES.fullmatch(name) or PRIVATE_WORDS.search(words)
        if is_defect and name not in BY_ANOTHER_NAME:
            yield f"{path.relative_to(REPOSITORY)}:{line}: {name}"


@pytest.mark.parametrize("room", ROOMS)
def test_docstrings_are_plain_english(room):
    assert [wrong for path in ROOMS[room] for wrong in offences(path)] == []


@pytest.mark.parametrize("room", ROOMS)
def test_names_are_nouns_of_the_field(room):
    assert [wrong for path in ROOMS[room] for wrong in misnomers(path)] == []


@pytest.mark.parametrize("package", [PACKAGE, TRANSLATOR], ids=lambda package: package.name)
def test_one_name_means_one_thing_in_the_whole_package(package):
    homes = defaultdict(list)
    for path in package.rglob("*.py"):
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                homes[node.name].append(str(path.relative_to(package)))
    several = {name: paths for name, paths in homes.items() if len(paths) > 1}
    assert several.keys() <= BY_ANOTHER_NAME.keys(), several


def documented_names(node):
    """The names in the list of arguments or attributes of a docstring."""
    listed = re.search(r"^(Args|Attributes):\n((?:    .*\n|\n)+)", (ast.get_docstring(node) or "") + "\n", re.M)
    items = re.findall(r"^    (\w[\w, ]*): ", listed[2], re.M) if listed else ()
    return {name.strip() for item in items for name in item.split(",")}


def names_within(node):
    """The arguments of a function, and what a class declares or sets."""
    arguments = {argument.arg for argument in ast.walk(node) if isinstance(argument, ast.arg)}
    targets = {target.id for target in ast.walk(node) if isinstance(target, ast.Name)}
    return arguments | targets | {target.attr for target in ast.walk(node) if isinstance(target, ast.Attribute)}


@pytest.mark.parametrize("room", ROOMS)
def test_docstrings_list_arguments_and_attributes_that_exist(room):
    for path in ROOMS[room]:
        for node in ast.walk(ast.parse(path.read_text())):
            is_property = any(
                getattr(decorator, "id", "") == "property" for decorator in getattr(node, "decorator_list", ())
            )
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not is_property:
                unknown = documented_names(node) - names_within(node)
                assert not unknown, f"{path.relative_to(REPOSITORY)}:{node.lineno}: {node.name}"


GROUPS = "players", "observations", "obstacles"
"""Groups of entry points, which no module is called after."""


def test_dotted_names_in_docstrings_exist():
    for path in PACKAGE.rglob("*.py"):
        for name in re.findall(r"`(apollonius(?:\.\w+)+)`", path.read_text()):
            assert name.removeprefix("apollonius.") in {*GROUPS} or pkgutil.resolve_name(name)


if __name__ == "__main__":
    for path in (path for room in sys.argv[1:] or ROOMS for path in ROOMS[room]):
        for wrong in [*offences(path), *misnomers(path)]:
            print(wrong)
