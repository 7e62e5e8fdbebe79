"""A barrier to fusion: the results are the function's own, and it is compiled as one call."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.accelerate.fusion_barrier import fusion_barrier


def clipped_or_zero(x):
    """Calls functions that JAX compiles on their own."""
    return jnp.where(jnp.clip(2 * x, -1, 1) > 0.5, x, 0)


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="the boundary is for XLA on the CPU")
def test_fusion_barrier_keeps_a_function_as_one_call():
    x = jnp.linspace(-1.0, 1.0, 64)
    compiled = jax.jit(lambda x: fusion_barrier(clipped_or_zero)(x) + 1).lower(x).compile()
    assert compiled.as_text().count(" call(") == 1
    np.testing.assert_array_equal(compiled(x), clipped_or_zero(x) + 1)
