"""The C sources: what they need, and that they do nothing undefined."""

import subprocess
from pathlib import Path
from shutil import which

import pytest

from apollonius.adapters.export import c
from tests.adapters.export.conftest import ONE_OF_EACH, Case

pytestmark = [
    pytest.mark.skipif(which("gcc") is None, reason="needs gcc"),
    pytest.mark.parametrize("case", ONE_OF_EACH, indirect=True),
]

MATHEMATICS = {"cosf", "sinf", "sincosf", "hypotf", "sqrtf", "ceilf", "fmaxf", "fminf", "tanhf"}
PROGRAM = """
#include <math.h>
#include <stdio.h>
#include "one.h"
#include "two.h"

int main(void)
{
    float state[8] = {1, 2, 0.5f, 3, 7, 6, 0, -9}, one[2], two[2];
    for (int i = 0; i < 50; i++) {
        state[i % 8] += 0.1f * (float)i;
        one_decide(state, one);
        two_decide(state, two);
        printf("%g %g, %g %g\\n", one[0], one[1], two[0], two[1]);
    }
    state[4] = NAN;
    one_decide(state, one);
    printf("%g %g\\n", one[0], one[1]);
    return 0;
}
"""


def write(case: Case, out: Path) -> None:
    for path, content in c.make_files(case.blueprint, out).items():
        path.write_bytes(content)


def gcc(folder, *arguments):
    subprocess.run(["gcc", *c.FLAGS, *arguments], cwd=folder, check=True)


def test_it_calls_nothing_but_mathematics(case, tmp_path):
    write(case, tmp_path / "one.c")
    gcc(tmp_path, "-Wunused-macros", "-c", "one.c")
    listed = subprocess.run(["nm", "one.o"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    symbols = [line.split() for line in listed.splitlines()]
    assert {symbol[-1] for symbol in symbols if symbol[-2] == "U"} <= MATHEMATICS
    assert {symbol[-1] for symbol in symbols if symbol[-2] == "T"} == {"one_decide"}
    assert not [symbol for symbol in symbols if symbol[-2] in "BbDd"], "nothing can be written to"


VALGRIND = ["valgrind", "-q", "--error-exitcode=9", "--leak-check=full"]


@pytest.mark.parametrize(
    "under", [[], pytest.param(VALGRIND, marks=pytest.mark.skipif(not which("valgrind"), reason="needs valgrind"))]
)
def test_two_policies_in_one_program_run_without_a_fault(case, tmp_path, under):
    for name in ("one", "two"):
        write(case, tmp_path / f"{name}.c")
    (tmp_path / "main.c").write_text(PROGRAM)
    gcc(tmp_path, "-g", "main.c", "one.c", "two.c", "-lm", "-o", "main")
    run = subprocess.run([*under, "./main"], cwd=tmp_path, check=True, capture_output=True, text=True)
    *lines, last = run.stdout.splitlines()
    assert len(set(lines)) > 1
    assert all(one == two for one, two in (line.split(", ") for line in lines))
    assert last == f"{-case.blueprint.own.u1_max:g} 0"
    assert run.stderr == ""


def test_the_loop_over_the_weights_is_made_into_vectors(case, tmp_path):
    write(case, tmp_path / "one.c")
    told = subprocess.run(
        ["gcc", *c.FLAGS, "-fopt-info-vec-optimized", "-c", "one.c"],
        cwd=tmp_path, check=True, capture_output=True, text=True,
    ).stderr  # fmt: skip
    source = (tmp_path / "one.c").read_text().splitlines()
    line = 1 + next(number for number, text in enumerate(source) if "in0 * row0[o]" in text)
    assert any(f"one.c:{line - 1}:" in row and "loop vectorized" in row for row in told.splitlines())


def test_a_compiler_that_would_not_notice_a_nan_is_refused(case, tmp_path, capfd):
    write(case, tmp_path / "one.c")
    with pytest.raises(subprocess.CalledProcessError):
        c.load(tmp_path / "one.c", (*c.FLAGS, "-ffast-math"))
    assert "-ffast-math" in capfd.readouterr().err
