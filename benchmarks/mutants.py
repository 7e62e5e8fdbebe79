"""Sample small changes of the code ("mutants") and count those that make a test fail.

    python benchmarks/mutants.py --mutants 200 --seed 0 --out mutants.jsonl

Every mutant changes one operator, comparison, number, condition or choice of the least for the greatest in a copy of
the package. A first run of all quick tests writes down which of their files call which functions. Then those that call
the changed function run, quickest first, and those of its room or that import its file, until one fails: a lower bound
of what all would notice. A mutant that no test notices survives: it is printed, to be read. A second call resumes where
the first one stopped.
"""

import argparse
import ast
import copy
import importlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Any

import jax
import pytest

LIBRARIES = (
    "beartype", "equinox", "hypothesis", "matplotlib.backends.backend_agg", "matplotlib.figure", "optax", "safetensors",
    "scipy.ndimage", "scipy.optimize", "scipy.sparse", "scipy.stats",
)  # fmt: skip
"""Imported once, before the processes that run the tests are forked."""
ROOT, PACKAGE = Path(__file__).parents[1], "apollonius"
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
FEW = 3
"""Files of tests that run at first; to read all takes as long."""
LONGEST = 3600
"""Seconds of a core for all tests."""
SKIPPED = (ast.AnnAssign, ast.Assert, ast.Raise, ast.JoinedStr)
"""Statements that decide nothing: an annotated field without a function, a message. No more does `strict` of `zip`."""


def mutants(source: str) -> Iterator[tuple[str, int, str, str, str]]:
    """Yield every mutant of a file: its function, its line, what stood there, what stands there now, the whole text."""
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    raw = source.encode()
    for function, node in _nodes(ast.parse(source), "", inside=False):
        before = ast.unparse(node)
        for changed in _changes(node):
            assert node.end_lineno is not None
            assert node.end_col_offset is not None
            begin = starts[node.lineno - 1] + node.col_offset
            end = starts[node.end_lineno - 1] + node.end_col_offset
            text = raw[:begin] + b"(" + changed.encode() + b")" + raw[end:]
            yield function, node.lineno, before, changed, text.decode()


def _nodes(node: ast.AST, name: str, inside: bool) -> Iterator[tuple[str, ast.expr]]:
    """Yield the expressions that functions compute with; no annotations, decorators, defaults or messages."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        name = name if inside else f"{name}.{node.name}".lstrip(".")
        for statement in node.body:
            yield from _nodes(statement, name, inside or isinstance(node, ast.FunctionDef))
        return
    if isinstance(node, SKIPPED) and not (inside and isinstance(node, ast.AnnAssign)):
        return
    if isinstance(node, ast.keyword) and node.arg == "strict":
        return
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("require", "print"):
        return
    if inside and isinstance(node, ast.expr):
        yield name, node
    if isinstance(node, ast.Subscript):
        yield from _nodes(node.value, name, inside)
        return
    children = [node.value] if isinstance(node, ast.AnnAssign) and node.value else ast.iter_child_nodes(node)
    for child in children:
        yield from _nodes(child, name, inside)


def _changes(node: ast.expr) -> Iterator[str]:
    """Yield what could stand there instead."""
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


def sample(root: Path, number: int, seed: int) -> list[tuple[str, str, int, str, str, str]]:
    """Return mutants of a tree, drawn evenly from all: file in the package, then as of `mutants`."""
    package = root / PACKAGE
    found = [
        (str(file.relative_to(package)), *mutant)
        for file in sorted(package.rglob("*.py"))
        for mutant in mutants(file.read_text())
    ]
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


class Callers:
    """A plugin of pytest that writes down the functions of the package that each file of tests calls, and its time."""

    def __init__(self, tree: Path, path: Path):
        self.path, self.package, self.file, self.began = path, str(tree / PACKAGE) + os.sep, "", 0.0
        self.calls: dict[str, set[str]] = defaultdict(set)
        self.seconds: dict[str, float] = defaultdict(float)

    def trace(self, frame: FrameType, event: str, argument: object) -> None:
        code = frame.f_code
        if code.co_filename.startswith(self.package):
            function = code.co_qualname.split(".<locals>")[0]
            self.calls[self.file].add(f"{code.co_filename.removeprefix(self.package)}:{function}")

    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        sys.settrace(self.trace)
        threading.settrace(self.trace)
        self.began = time.monotonic()
        if self.file != item.location[0]:
            jax.clear_caches()  # what is compiled is not called again
            self.file = item.location[0]

    def pytest_runtest_teardown(self) -> None:
        self.seconds[self.file] += time.monotonic() - self.began

    def pytest_sessionfinish(self) -> None:
        found = {file: {"seconds": time, "calls": sorted(self.calls[file])} for file, time in self.seconds.items()}
        self.path.write_text(json.dumps(found))


def run_tests(tree: Path, tests: list[str], plugin: object, limit: int) -> int:
    """Return the status of the tests in a process of its own, in which the changed code is read again.

    Args:
        limit: seconds of a core.
    """
    child = os.fork()
    if child == 0:
        status = pytest.ExitCode.INTERNAL_ERROR
        try:
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
            status = _run_tests(tree, tests, plugin)
        finally:
            os._exit(status)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # what the tests have left behind
    return status


def _run_tests(tree: Path, tests: list[str], plugin: object) -> int:
    os.setsid()
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)
    os.chdir(tree)
    os.environ |= {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(tree))
    options = ["-x", "-q", "-n", "0", "-p", "no:cacheprovider", "--timeout", "300", *QUIETLY]
    return int(pytest.main([*options, *tests], plugins=[plugin]))


def noticed(tree: Path, tests: list[str], limit: int) -> str:
    """Return the first test that fails, or nothing, also where there are none or they have not ended in time."""
    name = tree.parent / "failure"
    name.write_text("")
    if not tests:
        return ""
    status = run_tests(tree, tests, FirstFailure(name), limit)
    return "" if status in (pytest.ExitCode.OK, -signal.SIGKILL) else name.read_text() or "a crash"


def tests_of(tree: Path, file: str, function: str, callers: dict[str, dict[str, Any]]) -> list[str]:
    """Return the files of tests that call a function, its file's own first, and those of its room or that import it."""
    module = f"{PACKAGE}.{file.removesuffix('.py').replace(os.sep, '.')}"
    room, own = (tree / "tests").joinpath(file.split(os.sep)[0]), f"test_{Path(file).name}"
    found = []
    for path in (tree / "tests").rglob("test_*.py"):
        name = str(path.relative_to(tree))
        known = callers.get(name, {"seconds": 0, "calls": []})
        calls = f"{file}:{function}" in known["calls"]
        if calls or room in path.parents or module in path.read_text():
            found.append((path.name != own, not calls, known["seconds"], name))
    return [name for *_, name in sorted(found)]


def main() -> None:
    """Sample, run, write down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutants", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--part", type=int, nargs=2, default=(0, 1), help="every second number's mutants from the first"
    )
    parser.add_argument("--tree", type=Path, default=ROOT, help="the tree to change a copy of (default: this one)")
    parser.add_argument("--limit", type=int, default=300, help="seconds of a core for the tests of one mutant")
    parser.add_argument("--out", type=Path, default=Path("mutants.jsonl"), help="a line for each mutant")
    options = parser.parse_args()
    for library in LIBRARIES:
        importlib.import_module(library)
    first, step = options.part
    chosen = sample(options.tree, options.mutants, options.seed)[first::step]
    done = len(options.out.read_text().splitlines()) if options.out.exists() else 0
    calls = options.out.with_suffix(".calls.json").absolute()
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(options.tree, tree, ignore=shutil.ignore_patterns(".git", ".venv", "runs"))
        if not calls.exists() and run_tests(tree, ["tests"], Callers(tree, calls), LONGEST) != pytest.ExitCode.OK:
            raise SystemExit(f"the tests of {options.tree} fail without any change")
        callers = json.loads(calls.read_text())
        for count, (file, function, line, before, after, text) in enumerate(chosen[done:], done + 1):
            began, original = time.monotonic(), (tree / PACKAGE / file).read_text()
            (tree / PACKAGE / file).write_text(text)
            tests = tests_of(tree, file, function, callers)
            killer = noticed(tree, tests[:FEW], options.limit) or noticed(tree, tests[FEW:], options.limit)
            (tree / PACKAGE / file).write_text(original)
            record = {"file": file, "line": line, "before": before, "after": after, "killed_by": killer}
            record |= {"tests": len(tests), "seconds": round(time.monotonic() - began, 1)}
            with options.out.open("a") as out:
                out.write(json.dumps(record) + "\n")
            said = killer or f"SURVIVES {len(tests)} files of tests: {before}  ->  {after}"
            print(f"{count}/{len(chosen)} {file}:{line} {said}", flush=True)
    records = [json.loads(line) for line in options.out.read_text().splitlines()]
    killed = sum(bool(record["killed_by"]) for record in records)
    print(f"{killed} of {len(records)} mutants killed ({killed / max(1, len(records)):.1%})")


if __name__ == "__main__":
    main()
