"""Random bits are those of `jax.random`, whatever the key."""

import jax
import jax.numpy as jnp
import pytest
from numpy.testing import assert_array_equal

from apollonius.play.random_bits import fold_in, random_bits

KEYS = [jax.random.key(0), jax.random.key(2**31 + 5), jax.random.key(3, impl="rbg")]


@pytest.mark.parametrize("key", KEYS, ids=["0", "large", "rbg"])
@pytest.mark.parametrize("shape", [(), (3,), (2, 512)])
def test_words_are_those_of_jax(key, shape):
    words = random_bits(key, shape)
    assert words.dtype == jnp.uint32
    assert_array_equal(words, jax.random.bits(key, shape, jnp.uint32))


@pytest.mark.parametrize("key", KEYS, ids=["0", "large", "rbg"])
def test_keys_are_those_of_jax(key):
    numbers = jnp.asarray([0, 1, 2**31 - 1, -1], jnp.int32)
    ours, theirs = (jax.vmap(folded, in_axes=(None, 0))(key, numbers) for folded in (fold_in, jax.random.fold_in))
    assert jax.random.key_impl(ours) == jax.random.key_impl(key)
    assert_array_equal(jax.random.key_data(ours), jax.random.key_data(theirs))


def test_words_are_those_of_jax_where_words_are_counted_otherwise():
    key = jax.random.key(1)
    with jax.threefry_partitionable(False):
        theirs = jax.random.bits(key, (5,), jnp.uint32)
        assert_array_equal(random_bits(key, (5,)), theirs)
    assert (theirs != random_bits(key, (5,))).any(), "two ways to count"
