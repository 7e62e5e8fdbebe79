"""Programs are compared with JAX, and what a compiler says is one line."""

import os

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpr2c import CompiledProgram, CompilerFailure, Mismatch, check_program, compiler, has_compiler, translate
from jaxpr2c.compiler import FLAGS
from jaxpr2c.scalars import HELPERS
from tests.jaxpr2c.gcc import needs_gcc

X = np.array([-2.5, 0.5, 3.25, -0.0], np.float32)


@needs_gcc
@pytest.mark.parametrize("flag", ["-ffast-math", "-Ofast", "-ffinite-math-only"])
def test_fast_math_compiler_flags_are_refused(flag):
    with pytest.raises(CompilerFailure, match="compile without -Ofast, -ffast-math"):
        CompiledProgram(translate(lambda x: x + 1, X), (*FLAGS, flag))


@needs_gcc
def test_check_compares_with_jax_up_to_rounding(monkeypatch):
    def act(x, n):
        return {"low": jnp.floor(2 * jax.lax.logistic(x)), "nan": jnp.log(x) + n}

    example = np.float32([0, 1, -1]), 3
    program = translate(act, *example, name="tried")
    monkeypatch.setitem(HELPERS, "logistic", HELPERS["logistic"].replace("expf(-x))", "expf(-x)) - 1e-7f"))
    check_program(program, act, *example)
    monkeypatch.setitem(HELPERS, "logistic", HELPERS["logistic"].replace("- 1e-7f", "+ 1.0f"))
    with pytest.raises(Mismatch, match="tried in C differs from JAX"):
        check_program(program, act, *example)
    with pytest.raises(Mismatch, match="differs"):
        check_program(program, act, *jax.eval_shape(lambda: example))


@pytest.mark.parametrize(
    ("script", "needle"),
    [
        ("echo 'x.h:1: fatal error: no stdint.h' >&2; exit 1", "gcc fails .x.h:1: fatal error: no stdint.h"),
        ("exit 3", "gcc fails .exit status 3"),
        ("sleep 60; exit 0", "gcc does not work here .* timed out"),
        ("touch program", "gcc compiled cannot be loaded"),
    ],
)
def test_compiler_failure_is_one_line(tmp_path, monkeypatch, script, needle):
    (tmp_path / "gcc").write_text(f"#!/bin/sh\n{script}\n")
    (tmp_path / "gcc").chmod(0o755)
    monkeypatch.setattr(compiler, "_LONGEST", 0.5)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    program = translate(lambda x: x + 1, X)
    with pytest.raises(CompilerFailure, match=needle) as refused:
        check_program(program, lambda x: x + 1, X)
    assert "\n" not in str(refused.value)


def test_translation_needs_no_compiler(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert not has_compiler()
    assert translate(lambda x: x + 1, X).files().keys() == {"program.h", "program.c"}
    with pytest.raises(CompilerFailure, match="gcc does not work here"):
        CompiledProgram(translate(lambda x: x + 1, X))
