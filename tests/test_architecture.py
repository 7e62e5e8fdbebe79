"""The house keeps its order: imports go one way, in no circle, and every file holds one noun of modest size."""

import ast
import graphlib
import re
import sys
from collections import Counter

import pytest

from tests.documents import REPOSITORY
from website.house import PACKAGE, TRANSLATOR, imported, room_of, rooms, sources, table

HOUSE = (REPOSITORY / "docs" / "concepts" / "architecture.md").read_text()
FILES = sources()
LONGEST_FILE = 400
FLAG = re.compile(r"""["'](--[a-z][a-z-]*)""")
NAMELESS = {"utils", "common", "helpers"}


def is_of_some_encoding(node):
    """Whether this is a call that reads or writes text as the system's language has it."""
    if not isinstance(node, ast.Call) or any(one.arg == "encoding" for one in node.keywords):
        return False
    is_text = any(one.arg in ("text", "universal_newlines") for one in node.keywords)
    return is_text or getattr(node.func, "attr", "") in ("read_text", "write_text")


def violations(module, source):
    found, names = [], imported(ast.parse(source), set())
    if room_of(module) != "show" and any(name.split(".")[0] == "matplotlib" for name in names):
        found.append(f"{module}: imports Matplotlib, which is for show only")
    if len(source.splitlines()) > LONGEST_FILE:
        found.append(f"{module}: has more than {LONGEST_FILE} lines, so it holds more than one noun")
    if NAMELESS & set(module.split(".")):
        found.append(f"{module}: is called after nothing in particular")
    flags = FLAG.findall(source) if room_of(module) != "cli" else []
    found += [f"{module}: names {flag}, which only a command knows" for flag in flags]
    texts = [ast.unparse(call) for call in ast.walk(ast.parse(source)) if is_of_some_encoding(call)]
    found += [f"{module}: names no encoding in {text}" for text in texts]
    if "json.dumps(" in source and module != "apollonius.io.document":
        found.append(f"{module}: writes JSON without document.to_json, which knows no NaN")
    return found


def test_package_has_no_architecture_violations():
    assert {"apollonius", "apollonius.play.rollout", "apollonius.game.arena", "jaxpr2c.translator"} <= set(FILES)
    assert [found for module, source in FILES.items() for found in violations(module, source)] == []


def test_document_has_the_actual_rooms_and_imports():
    assert table(rooms(FILES)) in HOUSE, "python -m website.house draws the table"
    own = [module for module in FILES if module.startswith(PACKAGE)]
    assert sum(count > 1 for count in Counter(map(room_of, own)).values()) <= 20


def test_translator_imports_jax_and_numpy_alone():
    allowed = {TRANSLATOR, "jax", "numpy", *sys.stdlib_module_names}
    for module, source in FILES.items():
        if room_of(module) == TRANSLATOR:
            assert {name.split(".")[0] for name in imported(ast.parse(source), set())} <= allowed, module


@pytest.mark.parametrize(
    "statement",
    [
        "from apollonius.agents.policy import Pool",
        "import apollonius.agents",
        "def late():\n    from apollonius.agents import policy",
        "if TYPE_CHECKING:\n    import apollonius.agents",
    ],
)
def test_circular_imports_between_rooms_are_refused_in_any_position(statement):
    with pytest.raises(graphlib.CycleError):
        rooms({"apollonius.game.arena": statement, "apollonius.agents.policy": "from apollonius.game import arena"})


def at_once(source, modules):
    """What a file imports when it is loaded itself."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) or (
            isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        ):
            node.body = []
    return imported(tree, modules)


def test_files_have_no_circular_imports_at_load_time():
    needs = {module: at_once(source, set(FILES)) & set(FILES) - {module} for module, source in FILES.items()}
    graphlib.TopologicalSorter(needs).prepare()


@pytest.mark.parametrize("room", ["game", "arenas"])
def test_files_of_a_room_have_no_circular_imports_in_any_position(room):
    files = {module: source for module, source in FILES.items() if room_of(module) == room}
    needs = {module: imported(ast.parse(text), files) & set(files) - {module} for module, text in files.items()}
    graphlib.TopologicalSorter(needs).prepare()
