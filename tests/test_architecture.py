"""The house keeps its order: imports go one way, in no circle, and every file holds one noun of modest size."""

import ast
import graphlib
import re
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]
LONGEST_FILE = 250
FLAG = re.compile(r"""["'](--[a-z][a-z-]*)""")
NAMELESS = {"utils", "common", "helpers"}

ARROWS = {
    "version": "",
    "io": "version",
    "game": "io",
    "arenas": "game",
    "observe": "game",
    "agents": "arenas observe",
    "play": "agents",
    "solve": "agents",
    "catalogue": "solve",
    "learn": "catalogue play",
    "evaluate": "catalogue play",
    "exploit": "learn evaluate",
    "simulate": "evaluate",
    "show": "learn evaluate",
    "export": "catalogue play",
    "envs": "show",
    "web": "catalogue export",
    "apollonius": "learn envs export",
    "reproduce": "apollonius",
    "cli": "simulate exploit reproduce web",
}
"""What each part may know besides itself, with all that stands behind it. `apollonius` is the list of public names."""


def all_behind(arrows):
    """For each part all parts that its arrows lead to."""
    direct, behind = {name: set(parts.split()) for name, parts in arrows.items()}, {}
    for name in graphlib.TopologicalSorter(direct).static_order():
        behind[name] = direct[name].union(*(behind[other] for other in direct[name]))
    return behind


MAY_IMPORT = all_behind(ARROWS) | {"__main__": {"cli", "io"}}


def read(package):
    """Source text by module name; a folder's `__init__.py` is the module of the folder, and a stub is part of it."""
    sources = {}
    for path in [*package.rglob("*.py"), *package.rglob("*.pyi")]:
        name = ".".join(path.relative_to(package.parent).with_suffix("").parts).removesuffix(".__init__")
        sources[name] = sources.get(name, "") + path.read_text()
    return sources


def part(module):
    """The part of the house that a module belongs to: `apollonius.game.arena` is in `game`."""
    package, *inside = module.split(".")
    return inside[0] if package == "apollonius" and inside else package


def imports(source, module, modules):
    """Full names that a module imports anywhere, and those among them that it imports when it is loaded itself."""
    tree = ast.parse(source)
    later = {
        inner
        for block in ast.walk(tree)
        if isinstance(block, ast.FunctionDef | ast.AsyncFunctionDef) or is_for_type_checkers(block)
        for inner in ast.walk(block)
    }
    everywhere, at_once = set(), set()
    for node in ast.walk(tree):
        names = names_of(node, module, modules)
        everywhere |= names
        at_once |= names if node not in later else set()
    return everywhere, at_once


def is_for_type_checkers(node):
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


def names_of(node, module, modules):
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names}
    if isinstance(node, ast.ImportFrom):
        above = module.split(".")[: -node.level] if node.level else []
        source = ".".join([*above, *([node.module] if node.module else [])])
        submodules = {f"{source}.{alias.name}" for alias in node.names} & modules
        return submodules or {source}
    return set()


def violations(sources):
    """Every breach of the house's order, in words; `sources` is text by module name."""
    modules, found, needs = set(sources), [], {}
    for module, source in sources.items():
        here = part(module)
        everywhere, at_once = imports(source, module, modules)
        needs[module] = at_once & modules - {module}
        found += [f"{module}: no arrow says what '{here}' may import"] if here not in MAY_IMPORT else []
        for name in sorted(everywhere):
            ours = name.split(".")[0] == "apollonius"
            if ours and part(name) not in {here, *MAY_IMPORT.get(here, set())}:
                found.append(f"{module}: imports {name}, against the arrow")
            if name.split(".")[0] == "matplotlib" and here != "show":
                found.append(f"{module}: imports {name}, which is for show only")
        if len(source.splitlines()) > LONGEST_FILE:
            found.append(f"{module}: has more than {LONGEST_FILE} lines, so it holds more than one noun")
        if NAMELESS & set(module.split(".")):
            found.append(f"{module}: is called after nothing in particular")
        flags = FLAG.findall(source) if here != "cli" else []
        found += [f"{module}: names {flag}, which only a command knows" for flag in flags]
        if "json.dumps(" in source and module != "apollonius.io.document":
            found.append(f"{module}: writes JSON without document.to_json, which knows no NaN")
        if module == "apollonius.agents.zoo" and any(not is_docstring(node) for node in ast.parse(source).body):
            found.append(f"{module}: is code, but the zoo holds data only")
    try:
        graphlib.TopologicalSorter(needs).prepare()
    except graphlib.CycleError as error:
        found.append(f"imports go in a circle: {' <- '.join(error.args[1])}")
    return found


def is_docstring(node):
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def test_the_house_is_in_order():
    sources = read(REPOSITORY / "apollonius")
    assert {"apollonius", "apollonius.play.rollout", "apollonius.game.arena"} <= set(sources)
    assert violations(sources) == []


def test_what_a_part_may_import_it_may_import_with_all_that_stands_behind_it():
    assert all_behind({"roof": "wall", "wall": "stone", "stone": ""}) == {
        "roof": {"wall", "stone"},
        "wall": {"stone"},
        "stone": set(),
    }


def test_no_part_may_import_itself_by_way_of_others():
    with pytest.raises(graphlib.CycleError):
        all_behind({"game": "agents", "agents": "rollout", "rollout": "game"})


def test_training_and_judging_do_not_know_each_other():
    assert "learn" not in MAY_IMPORT["evaluate"]
    assert "evaluate" not in MAY_IMPORT["learn"]


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("apollonius.agents.greedy", "from apollonius.game.types import Scalar"),
        ("apollonius.learn.stage", "from apollonius.learn import dqn"),
        (
            "apollonius.game.validation",
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import apollonius.game",
        ),
        ("apollonius.show.style", "import matplotlib.pyplot as plt"),
        ("apollonius.cli.train", "def train():\n    from apollonius.learn.run import Run"),
        ("apollonius.agents.zoo", '"""Nothing but agents."""'),
        ("apollonius.reproduce.study", "from apollonius import Game"),
    ],
)
def test_good_imports_pass(module, source):
    assert violations({module: source}) == []


@pytest.mark.parametrize(
    ("module", "source", "complaint"),
    [
        ("apollonius.game.arena", "from apollonius.agents.policy import Pool", "against the arrow"),
        ("apollonius.game.arena", "import apollonius.play.rollout", "against the arrow"),
        ("apollonius.game.arena", "import apollonius", "against the arrow"),
        ("apollonius.game.arena", "def late():\n    from apollonius.play.rollout import collect", "against the arrow"),
        ("apollonius.game.arena", "if TYPE_CHECKING:\n    from apollonius.learn import dqn", "against the arrow"),
        ("apollonius.game.arena", "from ..agents.policy import Pool", "against the arrow"),
        ("apollonius.learn.stage", "from apollonius.evaluate.match import play_match", "against the arrow"),
        ("apollonius.evaluate.match", "from apollonius.learn.train_state import Plan", "against the arrow"),
        ("apollonius.solve.grid", "from apollonius.play.rollout import collect", "against the arrow"),
        ("apollonius.show.canvas", "from apollonius.envs.live import View", "against the arrow"),
        ("apollonius.evaluate.match", "import matplotlib.pyplot as plt", "for show only"),
        ("apollonius.cli.main", "def show():\n    from matplotlib import pyplot", "for show only"),
        ("apollonius.learn.stage", "from apollonius.exploit.attack import Attack", "against the arrow"),
        ("apollonius.exploit.attack", "from apollonius.reproduce.finding import Finding", "against the arrow"),
        ("apollonius.show.style", "from apollonius import Game", "against the arrow"),
        ("apollonius.game.arena", "x = 1\n" * 251, "more than 250 lines"),
        ("apollonius.game.utils", "", "after nothing in particular"),
        ("apollonius.helpers.arena", "", "after nothing in particular"),
        ("apollonius.sundry", "", "no arrow says"),
        ("apollonius.learn.folder", 'require(force, "--out", folder, "new")', "names --out"),
        ("apollonius.agents.zoo", "import jax", "data only"),
        ("apollonius.cli.solve", "print(json.dumps({}))", "without document.to_json"),
    ],
)
def test_each_breach_is_found(module, source, complaint):
    assert any(complaint in found for found in violations({module: source}))


def test_a_circle_of_imports_is_found_even_within_one_part():
    sources = {
        "apollonius.game.arena": "from apollonius.game.game import Game",
        "apollonius.game.game": "from apollonius.game import reward",
        "apollonius.game.reward": "if True:\n    import apollonius.game.arena",
    }
    assert ["circle" in found for found in violations(sources)] == [True]


@pytest.mark.parametrize("when", ["def late():\n    ", "if TYPE_CHECKING:\n    "])
def test_an_import_that_does_not_run_on_loading_closes_no_circle(when):
    sources = {
        "apollonius.game.arena": f"{when}from apollonius.game.game import Game",
        "apollonius.game.game": "from apollonius.game.arena import Arena",
    }
    assert violations(sources) == []


HOUSE = (REPOSITORY / "docs" / "architecture.md").read_text()


def test_the_picture_of_the_house_names_the_rooms_that_there_are():
    picture = re.search(r"## The rooms\n\n```text\n(.*?)```", HOUSE, re.DOTALL)
    rooms = set(re.findall(r"[a-z_]+", picture[1].replace("all of them, but", "").replace("the command", "")))
    assert len(rooms) > 12
    assert rooms <= set(ARROWS)


def walks(document):
    """The files that each walk of a document passes, in order."""
    sections = document.split("\n## From ")[1:]
    return {section.splitlines()[0]: re.findall(r"^\d+\. `([^`]+)`", section, re.MULTILINE) for section in sections}


def knows(path, other):
    """Whether a file imports another one, Python or JavaScript."""
    text = (REPOSITORY / path).read_text()
    if path.endswith(".js"):
        return f'from "./{Path(other).name}"' in text
    module, known = (name.removesuffix(".py").replace("/", ".") for name in (path, other))
    return known in imports(text, module, set(read(REPOSITORY / "apollonius")))[0]


WALKS = walks(HOUSE)


@pytest.mark.parametrize("walk", WALKS)
def test_a_walk_through_the_house_never_goes_back_up(walk):
    files = WALKS[walk]
    assert len(files) >= 5
    for number, path in enumerate(files[1:], start=1):
        assert any(knows(before, path) for before in files[:number]), f"nothing above imports {path}"
