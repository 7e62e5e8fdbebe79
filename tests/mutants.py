"""Sample small changes of the code ("mutants"), made by Cosmic Ray, and count those that make a test fail.

    make mutants

In a copy of the tree each mutant meets the quick tests of its room and those that import its file, until one fails: a
lower bound of what all tests would notice. One that survives is printed, to be read. A second call resumes where the
first one stopped.
"""

import argparse
import json
import os
import random
import re
import shutil
import sys
import tempfile
from pathlib import Path

from cosmic_ray.commands.init import init  # pyright: ignore[reportMissingImports]
from cosmic_ray.mutating import mutate_and_test  # pyright: ignore[reportMissingImports]
from cosmic_ray.work_db import use_db  # pyright: ignore[reportMissingImports]
from cosmic_ray.work_item import MutationSpec, TestOutcome  # pyright: ignore[reportMissingImports]

ROOT, PACKAGES = Path(__file__).parents[1], ("apollonius", "jaxpr2c")
NOISE = re.compile(r"core/(ReplaceBinaryOperator_BitOr_|RemoveDecorator|ExceptionReplacer)")
"""Changes of annotations (`int | None`), and such that hardly anything survives."""
PYTEST = f"{sys.executable} -m pytest -x -q -n 0 -p no:cacheprovider --timeout 300"


def sample(folders: list[str], number: int, seed: int) -> list[MutationSpec]:
    """Return mutants of some folders, each at a place of its own, drawn evenly from all."""
    with tempfile.TemporaryDirectory() as folder, use_db(f"{folder}/all.sqlite") as found:
        init(sorted(path for folder in folders for path in Path(folder).rglob("*.py")), found, {})
        every = [item.mutations[0] for item in found.work_items]
    every = sorted(
        (one for one in every if not NOISE.match(one.operator_name)),
        key=lambda one: (str(one.module_path), one.start_pos, one.end_pos, one.operator_name),
    )
    random.Random(seed).shuffle(every)
    places = {(one.module_path, one.start_pos, one.end_pos): one for one in every}
    return list(places.values())[:number]


def tests_of(file: Path) -> list[str]:
    """Return the files of tests of a file's room, its own first, and those that import it."""
    module = ".".join(file.with_suffix("").parts)
    room = Path("tests").joinpath(file.parts[file.parts[0] == "apollonius"])
    found = sorted(
        (path.name != f"test_{file.name}", str(path))
        for path in Path("tests").rglob("test_*.py")
        if room in path.parents or module in path.read_text()
    )
    return [name for _, name in found]


def main() -> None:
    """Sample, run, write down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", default=PACKAGES, help="default: all of the packages")
    parser.add_argument("--mutants", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit", type=int, default=900, help="seconds for the tests of one mutant")
    parser.add_argument("--out", type=Path, default=Path("mutants.jsonl"), help="a line for each mutant")
    options = parser.parse_args()
    out = options.out.absolute()
    lines = out.read_text().splitlines() if out.exists() else []
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".git", ".venv", "runs", "build"))
        os.chdir(tree)
        os.environ["PYTHONPATH"] = str(tree)
        for number, mutant in enumerate(
            sample(options.folders, options.mutants, options.seed)[len(lines) :], len(lines) + 1
        ):
            tests = tests_of(Path(mutant.module_path))
            made = mutate_and_test([mutant], f"{PYTEST} {' '.join(tests)}", options.limit)
            killed = bool(tests) and made.test_outcome != TestOutcome.SURVIVED
            lines.append(json.dumps({"file": str(mutant.module_path), "change": made.diff, "killed": killed}))
            out.write_text("\n".join(lines) + "\n")
            said = "killed" if killed else f"SURVIVES {len(tests)} files of tests\n{made.diff}"
            print(f"{number}/{options.mutants} {mutant.module_path}:{mutant.start_pos[0]} {said}", flush=True)
    killed = sum(json.loads(line)["killed"] for line in lines)
    print(f"{killed} of {len(lines)} mutants killed ({killed / max(1, len(lines)):.1%})")


if __name__ == "__main__":
    main()
