"""Names of arguments, results and programs are names in C too, or they are refused."""

import subprocess

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpr2c import Unsupported, translate
from jaxpr2c.names import is_taken, require_name
from jaxpr2c.program import c_names
from jaxpr2c.record import record_of
from jaxpr2c.scalars import HELPERS
from tests.jaxpr2c.gcc import needs_gcc
from tests.jaxpr2c.test_translator import CASES, X


@pytest.mark.parametrize(("function", "cases"), CASES)
def test_names_used_inside_a_program_are_refused(function, cases):
    program = translate(function, *cases[0], name="tried")
    given = {record.name for record in program.records} | {*map("{0.name}->".format, program.records)}
    used = c_names("".join([program.body, *program.functions, *HELPERS.values()]))
    local = {"a", "b", "x", "by", "most", "bits", "both"}  # of the helpers, which no argument reaches
    for word in used - given - local:
        if "->" not in word:
            with pytest.raises(Unsupported, match="mean nothing in C and C"):
                require_name("name", word)


HEADERS = """assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdarg stdbool
stddef stdint stdio stdlib string tgmath time wchar wctype"""


@needs_gcc
def test_names_of_c_macros_and_library_functions_are_taken():
    headers = "".join(f"#include <{name}.h>\n" for name in HEADERS.split())
    for standard, text in (("c99", headers), ("gnu99", "")):
        run = ["gcc", f"-std={standard}", "-dM", "-E", "-"]
        lines = subprocess.run(run, input=text, capture_output=True, text=True, check=True).stdout.splitlines()
        macros = {line.split()[1] for line in lines}
        objects = {name for name in macros if "(" not in name and not name.startswith("_")}
        assert {"NULL", "INT32_MAX", "stdin"} <= objects or objects == {"linux", "unix"}
        assert [name for name in sorted(objects) if not is_taken(name)] == []
    for name in ("main", "printf", "sin", "class", "9x", "a b", "../x", "", "übung"):
        with pytest.raises(Unsupported, match="program's name"):
            translate(lambda x: x + 1, X, name=name)


@pytest.mark.parametrize(
    ("function", "name"),
    [
        (lambda sinf: sinf + 1, "name of an argument = 'sinf'"),
        (lambda NAN: NAN + 1, "name of an argument = 'NAN'"),
        (lambda tried_y: {"y": tried_y + 1}, "does not begin with tried_"),
        (lambda x: {"class": x + 1}, "name of a result = 'class'"),
        (lambda x: {9: x + 1}, "name of a result = '9'"),
        (lambda x: {"x": x, "next_x": x}, "next_x is not possible: it must be the name of no other"),
        (lambda *x: x[0] + 1, "number of arguments = 1 .* at most 0"),
        (lambda x: x[4:], r"shape of result = \(0,\)"),
        (lambda x: x + np.zeros((1001, 1000, 4)), "constant array = .* make it an argument"),
        (lambda x: x.astype(jnp.float16), "kind 'float16'"),
    ],
)
def test_names_and_shapes_that_c_cannot_have_are_refused(function, name):
    with pytest.raises(Unsupported, match=name):
        translate(function, X, name="tried")


@pytest.mark.parametrize("argument", [jax.random.key(0), np.zeros((0, 3), np.float32), np.float16(1), 1j])
def test_arguments_of_types_unknown_to_c_are_refused(argument):
    with pytest.raises(Unsupported, match="of x = "):
        translate(lambda x: x, argument)


def test_leaf_names_are_valid_and_unique_in_c():
    tree = {"A": X, "a": X, "a_2": X, "class": X, "9": X, "ü": X, "linux": X, "x y": X}
    names = [leaf.name for leaf in record_of("tree", tree).leaves]
    assert names == ["value_9", "a", "a_2", "a_2_2", "class_", "linux_", "x_y", "value"]
