"""How much the tests notice: sampled small changes of the code ("mutants"), and which of them make a test fail.

    python benchmarks/mutants.py --mutants 200 --seed 0 --out mutants.jsonl

Every mutant changes one operator, comparison, number, condition or choice of the least for the greatest, in a copy of
the tree. The tests of its file run first, then those of its room and of what stands on it, until the first failure,
and without the slow ones; the rest of the tests might notice a few more, so the share is a lower bound. A mutant that
no test notices survives: it is printed, to be read. A line of the file is written for each one, and a second call goes
on where the first one stopped. All of these tests run once without a change first, for whatever fails then would
notice everything.
"""

import argparse
import ast
import copy
import importlib
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

LIBRARIES = ("beartype", "equinox", "jax.numpy", "optax", "safetensors", "scipy.optimize", "scipy.stats")
"""Imported once, before the processes that run the tests are forked."""
ROOT, PACKAGE = Path(__file__).parents[1], "apollonius"
CHANGED = (
    "game", "play", "learn/replay_buffer.py", "learn/dqn.py", "learn/archive.py",
    "learn/opponents.py", "solve", "agents/shield.py",
)  # fmt: skip
"""The files and folders of the package that are changed."""
LEARNING = "learn/test_dqn.py learn/test_replay_buffer.py learn/test_opponents.py learn/test_train_step.py learn"
ONE_ROBOT = "solve/test_grid.py solve/test_transition_map.py solve/test_safety.py solve/test_reach.py"
TWO_ROBOTS = "solve/test_zero_sum_game.py solve/test_response.py solve/test_joint.py solve/test_chance.py"
FILES = "solve/test_store.py solve/test_solving.py"
TESTS = {
    "game": "game play",
    "game/dynamics.py": "game play agents/test_shield.py",
    "game/nearby.py": "game agents/test_shield.py",
    "game/polygon.py": "game agents/test_shield.py",
    "play": "play evaluate/test_match.py",
    "learn": LEARNING,
    "solve": f"{TWO_ROBOTS} {ONE_ROBOT} {FILES}",
    "solve/grid.py": f"{ONE_ROBOT} {TWO_ROBOTS}",
    "solve/transition_map.py": f"{ONE_ROBOT} {TWO_ROBOTS}",
    "solve/motion.py": f"{ONE_ROBOT} {TWO_ROBOTS}",
    "solve/safety.py": "solve/test_safety.py evaluate/test_match.py",
    "solve/viability.py": "solve/test_safety.py evaluate/test_match.py",
    "solve/reach.py": "solve/test_reach.py",
    "solve/players.py": f"{TWO_ROBOTS} {FILES}",
    "solve/store.py": f"{FILES} io/test_files_that_lie.py",
    "agents/shield.py": "agents",
}
"""The tests that may notice, in the order in which they are asked: by the longest of these that a file's path begins
with."""
SWAPS: dict[type, type] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult,
    ast.Pow: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.LShift: ast.RShift, ast.RShift: ast.LShift,
    ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip
NAMES = {"minimum": "maximum", "maximum": "minimum", "min": "max", "max": "min", "any": "all", "all": "any",
         "sin": "cos", "cos": "sin", "argmin": "argmax", "argmax": "argmin"}  # fmt: skip
QUIETLY = ("-W", "ignore::pytest.PytestAssertRewriteWarning")
"""Libraries that are pytest's plugins too have been imported before it."""
SKIPPED = (ast.AnnAssign, ast.Assert, ast.Raise, ast.JoinedStr)
"""Statements that decide nothing: an annotated field without a function, a message."""


def mutants(source: str) -> Iterator[tuple[int, str, str, str]]:
    """Every mutant of a file: its line, what stood there, what stands there now, and the whole text."""
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    raw = source.encode()
    for node in _nodes(ast.parse(source), inside=False):
        before = ast.unparse(node)
        for changed in _changes(node):
            assert node.end_lineno is not None
            assert node.end_col_offset is not None
            begin = starts[node.lineno - 1] + node.col_offset
            end = starts[node.end_lineno - 1] + node.end_col_offset
            text = raw[:begin] + b"(" + changed.encode() + b")" + raw[end:]
            yield node.lineno, before, changed, text.decode()


def _nodes(node: ast.AST, inside: bool) -> Iterator[ast.expr]:
    """The expressions that functions compute with; no annotations, decorators, defaults or messages."""
    if isinstance(node, ast.FunctionDef):
        for statement in node.body:
            yield from _nodes(statement, True)
        return
    if isinstance(node, SKIPPED) and not (inside and isinstance(node, ast.AnnAssign)):
        return
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("require", "print"):
        return
    if inside and isinstance(node, ast.expr):
        yield node
    if isinstance(node, ast.Subscript):
        yield from _nodes(node.value, inside)
        return
    children = [node.value] if isinstance(node, ast.AnnAssign) and node.value else ast.iter_child_nodes(node)
    for child in children:
        yield from _nodes(child, inside)


def _changes(node: ast.expr) -> Iterator[str]:
    """What could stand there instead."""
    changed = copy.deepcopy(node)
    match changed:
        case ast.Compare(ops=[op]) if type(op) in SWAPS:
            changed.ops = [SWAPS[type(op)]()]
        case ast.BinOp(op=op) | ast.BoolOp(op=op) if type(op) in SWAPS:
            changed.op = SWAPS[type(op)]()
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert()):
            changed = changed.operand
        case ast.Constant(value=bool() as value):
            changed = ast.Constant(not value)
        case ast.Constant(value=(int() | float()) as value):
            changed = ast.Constant(value + 1)
        case ast.IfExp():
            changed.body, changed.orelse = changed.orelse, changed.body
        case ast.Call(func=ast.Attribute(attr=name) as function) if name in NAMES:
            function.attr = NAMES[name]
        case ast.Call(func=ast.Attribute(attr="where"), args=[_, first, second]):
            changed.args[1:] = [second, first]
        case _:
            return
    yield ast.unparse(changed)


def sample(root: Path, number: int, seed: int) -> list[tuple[str, int, str, str, str]]:
    """Mutants of a tree: file in the package, line, before, after and text, drawn evenly from all that there are."""
    found = []
    package = root / PACKAGE
    for name in CHANGED:
        path = package / name
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            found += [(str(file.relative_to(package)), *mutant) for mutant in mutants(file.read_text())]
    return random.Random(seed).sample(found, min(number, len(found)))


class FirstFailure:
    """A plugin of pytest that writes down which test failed, or could not be read."""

    def __init__(self, path: Path):
        self.path = path

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.path.write_text(report.nodeid)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.path.write_text(report.nodeid)


def noticed(tree: Path, tests: list[str], limit: float) -> str:
    """The first test that fails, or nothing. What hangs is noticed too."""
    name = tree.parent / "failure"
    name.write_text("")
    child = os.fork()
    if child == 0:
        status = pytest.ExitCode.INTERNAL_ERROR
        try:
            status = _run_tests(tree, tests, name)
        finally:
            os._exit(status)
    end = time.monotonic() + limit
    while (ended := os.waitpid(child, os.WNOHANG))[0] == 0 and time.monotonic() < end:
        time.sleep(0.05)
    if ended[0] == 0:
        os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
        return "too slow"
    return "" if os.waitstatus_to_exitcode(ended[1]) == pytest.ExitCode.OK else name.read_text() or "a crash"


def _run_tests(tree: Path, tests: list[str], failure: Path) -> int:
    """The whole life of a forked process: libraries are there already, the changed code is read anew."""
    os.setsid()
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)
    os.chdir(tree)
    os.environ |= {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(tree))
    options = ["-x", "-q", "-n", "0", "-p", "no:cacheprovider", "--timeout", "120", *QUIETLY]
    return int(pytest.main([*options, *tests], plugins=[FirstFailure(failure)]))


def tests_of(tree: Path, file: str) -> list[str]:
    """The files of tests that may notice a change of a file, its own first."""
    own = str(Path(file).parent / f"test_{Path(file).name}")
    tests = TESTS[max((start for start in TESTS if file.startswith(start)), key=len)]
    return _files(tree, [own, *tests.split()])


def _files(tree: Path, names: list[str]) -> list[str]:
    """Files of tests, those of a folder for the folder, each once and in order."""
    paths = [tree / "tests" / name for name in names]
    files = [path for one in paths for path in (sorted(one.glob("test_*.py")) if one.is_dir() else [one])]
    return list(dict.fromkeys(str(file.relative_to(tree)) for file in files if file.exists()))


def main() -> None:
    """Sample, run, write down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutants", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tree", type=Path, default=ROOT, help="the tree to change a copy of (default: this one)")
    parser.add_argument("--share", default="0/1", help="of several processes: number/processes (default: %(default)s)")
    parser.add_argument("--limit", type=float, default=900, help="seconds for the tests of one mutant")
    parser.add_argument("--out", type=Path, default=Path("mutants.jsonl"))
    options = parser.parse_args()
    for library in LIBRARIES:
        importlib.import_module(library)
    number, processes = map(int, options.share.split("/"))
    chosen = sample(options.tree, options.mutants, options.seed)[number::processes]
    done = len(options.out.read_text().splitlines()) if options.out.exists() else 0
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(options.tree, tree, ignore=shutil.ignore_patterns(".git", ".venv", "runs"))
        everything = _files(tree, " ".join(TESTS.values()).split())
        if not done and (failed := noticed(tree, everything, len(TESTS) * options.limit)):
            sys.exit(f"{failed} fails without any change")
        for count, (file, line, before, after, text) in enumerate(chosen[done:], done + 1):
            began, original = time.monotonic(), (tree / PACKAGE / file).read_text()
            (tree / PACKAGE / file).write_text(text)
            killer = noticed(tree, tests_of(tree, file), options.limit)
            (tree / PACKAGE / file).write_text(original)
            record = {"file": file, "line": line, "before": before, "after": after, "killed_by": killer}
            record["seconds"] = round(time.monotonic() - began, 1)
            with options.out.open("a") as out:
                out.write(json.dumps(record) + "\n")
            print(
                f"{count}/{len(chosen)} {file}:{line} {killer or 'SURVIVES: ' + before + '  ->  ' + after}", flush=True
            )
    records = [json.loads(line) for line in options.out.read_text().splitlines()]
    killed = sum(bool(record["killed_by"]) for record in records)
    print(f"{killed} of {len(records)} mutants killed ({killed / len(records):.1%})")


if __name__ == "__main__":
    main()
