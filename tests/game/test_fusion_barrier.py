"""What is computed apart is one program of its own, not several."""

import jax
import jax.numpy as jnp
import pytest
from numpy.testing import assert_array_equal

from apollonius.game.fusion_barrier import fusion_barrier


def clipped_or_zero(x):
    """Calls functions that JAX compiles on their own."""
    return jnp.where(jnp.clip(2 * x, -1, 1) > 0.5, x, 0)


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="the boundary is for XLA on the CPU")
def test_a_boundary_stands_around_a_function_and_nowhere_within():
    x = jnp.linspace(-1.0, 1.0, 64)
    compiled = jax.jit(lambda x: fusion_barrier(clipped_or_zero)(x) + 1).lower(x).compile()
    assert compiled.as_text().count(" call(") == 1
    assert_array_equal(compiled(x), clipped_or_zero(x) + 1)
