"""How every test runs: no silent promotion, compilations kept between runs, the same examples each time."""

import os
from pathlib import Path

import hypothesis
import jax
import pytest

jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
KEPT = Path(__file__).parents[1] / ".jax_cache"
jax.config.update("jax_compilation_cache_dir", str(KEPT))
os.environ.setdefault("APOLLONIUS_CACHE", str(KEPT / "commands"))  # of the commands that tests run as processes
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)

hypothesis.settings.register_profile("apollonius", deadline=None, derandomize=True, max_examples=100)
hypothesis.settings.load_profile("apollonius")


@pytest.fixture(scope="module", autouse=True)
def forget_compilations():
    """A process that keeps the compilations of a thousand tests comes to the end of its memory maps, and crashes."""
    yield
    jax.clear_caches()


@pytest.fixture(autouse=True)
def no_lines_about_waiting(monkeypatch):
    """A command says that it is still at work by the clock; what it prints here depends on none."""
    monkeypatch.setattr("apollonius.display._FIRST_SECONDS", 1e9)
