"""The C compiler, as the tests call it."""

from shutil import which

import pytest

from jaxpr2c.compiler import FLAGS

needs_gcc = pytest.mark.skipif(which("gcc") is None, reason="needs gcc: install the package gcc")
STRICT = (*FLAGS, "-Wall", "-Wextra", "-Wpedantic", "-Werror")
SANITIZED = (*STRICT, "-fsanitize=undefined", "-fno-sanitize-recover")
