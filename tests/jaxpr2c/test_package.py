"""The package stands alone, and its README does what it says."""

import subprocess
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

import jaxpr2c
from tests.documents import REPOSITORY, blocks
from tests.jaxpr2c.gcc import STRICT, needs_gcc

README = REPOSITORY / "jaxpr2c" / "README.md"
ALONE = """
import sys
import jaxpr2c
assert {"jax", "numpy"}.isdisjoint(sys.modules), "names are imported when they are used"
for name in jaxpr2c.__all__:
    getattr(jaxpr2c, name)
print(sorted({module.split(".")[0] for module in sys.modules} & {"apollonius", "equinox", "jaxtyping", "optax"}))
"""


def test_import_brings_nothing_of_the_games():
    output = subprocess.check_output([sys.executable, "-c", ALONE], cwd=REPOSITORY, text=True)
    assert output == "[]\n"


def test_public_names_are_those_of_the_stub():
    assert {"CompiledProgram", "Program", "TranslationError", "check_program", "translate"} <= set(dir(jaxpr2c))
    with pytest.raises(AttributeError, match="module 'jaxpr2c' has no attribute 'trace'"):
        jaxpr2c.trace  # noqa: B018
    text = README.read_text()
    assert [name for name in dir(jaxpr2c) if f"`{name}" not in text] == []


@needs_gcc
def test_example_of_the_readme_controls_in_c_as_in_jax(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in blocks(README):
        if block.language == "python":
            exec(block.code, names)
        if block.language == "c":
            Path("main.c").write_text(block.code, encoding="utf-8")
    command = ["gcc", *STRICT, "-fsanitize=address,undefined", "main.c", "pendulum.c", "-lm", "-o", "pendulum"]
    subprocess.run(command, check=True)
    torques = np.array(subprocess.check_output("./pendulum", text=True).split(), float)
    state, expected = names["state"], []
    for _ in torques:
        results = jax.jit(names["control"])(names["weights"], state)
        state = results["state"]
        expected.append(float(results["torque"]))
    np.testing.assert_allclose(torques, expected, atol=1e-4)
    assert len({*torques}) == len(torques) == 3
