"""Random bits in one pass, against those of JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.accelerate.threefry import threefry_bits


@pytest.mark.parametrize("key", [jax.random.key(2**31 + 5), jax.random.key(3, impl="rbg")], ids=["threefry", "rbg"])
def test_threefry_bits_match_jax(key):
    for shape in ((), (2, 512)):
        np.testing.assert_array_equal(threefry_bits(key, shape), jax.random.bits(key, shape, jnp.uint32))
    with jax.threefry_partitionable(False):  # two ways to count words
        np.testing.assert_array_equal(threefry_bits(key, (5,)), jax.random.bits(key, (5,), jnp.uint32))
