"""Random bits are those of `jax.random`, whatever the key."""

import jax
import jax.numpy as jnp
import pytest
from numpy.testing import assert_array_equal

from apollonius.play.random_bits import fold_in, random_bits


@pytest.mark.parametrize("key", [jax.random.key(2**31 + 5), jax.random.key(3, impl="rbg")], ids=["threefry", "rbg"])
def test_words_and_keys_are_those_of_jax(key):
    for shape in ((), (2, 512)):
        assert_array_equal(random_bits(key, shape), jax.random.bits(key, shape, jnp.uint32))
    numbers = jnp.asarray([0, 1, 2**31 - 1, -1], jnp.int32)
    ours, theirs = (jax.vmap(folded, in_axes=(None, 0))(key, numbers) for folded in (fold_in, jax.random.fold_in))
    assert jax.random.key_impl(ours) == jax.random.key_impl(key)
    assert_array_equal(jax.random.key_data(ours), jax.random.key_data(theirs))
    with jax.threefry_partitionable(False):  # two ways to count words
        assert_array_equal(random_bits(key, (5,)), jax.random.bits(key, (5,), jnp.uint32))
