"""Random bits, the same as those of `jax.random`, in one pass.

On the CPU, JAX computes its hash by a loop of five groups of rounds, each of which reads and writes
memory. Here they are unrolled, so that each number is computed in one pass.
"""

import functools
import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray, UInt32

from apollonius.game.fusion_barrier import fusion_barrier

_PARITY = 0x1BD11BDA
_ROTATIONS = ((13, 15, 26, 6), (17, 29, 16, 24))
_GROUPS = 5


def threefry_bits(key: PRNGKeyArray, shape: tuple[int, ...]) -> UInt32[Array, "..."]:
    """Return random bits: `jax.random.bits(key, shape, "uint32")`, bit by bit, fewer than 2^32
    words.
    """
    if not _is_default_key(key):
        return jax.random.bits(key, shape, jnp.uint32)
    return fusion_barrier(functools.partial(_words, shape))(jax.random.key_data(key))


def fold_in(key: PRNGKeyArray, number: Int[Array, ""]) -> PRNGKeyArray:
    """Return the key of a key and a number of 32 bits: `jax.random.fold_in(key, number)`, bit by
    bit.
    """
    if not _is_default_key(key):
        return jax.random.fold_in(key, number)
    data = jnp.stack(_hash(jax.random.key_data(key), number.astype(jnp.uint32)))
    return jax.random.wrap_key_data(data, impl=jax.random.key_impl(key))


def _is_default_key(key: PRNGKeyArray) -> bool:
    """Check whether JAX hashes such keys, and counts words, as this module: its default."""
    is_partitionable = jax.config.jax_threefry_partitionable
    return jax.random.key_impl(key) == "threefry2x32" and is_partitionable


def _words(shape: tuple[int, ...], key: UInt32[Array, "2"]) -> UInt32[Array, "..."]:
    high, low = _hash(key, jnp.arange(math.prod(shape), dtype=jnp.uint32).reshape(shape))
    return high ^ low


def _hash(
    key: UInt32[Array, "2"], counter: UInt32[Array, "..."]
) -> tuple[UInt32[Array, "..."], UInt32[Array, "..."]]:
    """Return two words of each counter: Threefry-2x32 with 20 rounds (Salmon et al., 2011)."""
    keys = (key[0], key[1], key[0] ^ key[1] ^ jnp.uint32(_PARITY))
    high, low = jnp.full_like(counter, keys[0]), counter + keys[1]
    for group in range(_GROUPS):
        for rotation in _ROTATIONS[group % 2]:
            high = high + low
            low = high ^ ((low << rotation) | (low >> (32 - rotation)))
        high = high + keys[(group + 1) % 3]
        low = low + keys[(group + 2) % 3] + jnp.uint32(group + 1)
    return high, low


def random_bits_of(
    key: PRNGKeyArray, index: Int[Array, " games"], step: Int[Array, " games"]
) -> UInt32[Array, "2 games"]:
    """Return random bits of either side, by the game's index and its step alone; step -1 is the
    beginning.
    """

    def sample(index: Int[Array, ""], step: Int[Array, ""]) -> UInt32[Array, "2"]:
        return jax.random.bits(
            jax.random.fold_in(jax.random.fold_in(key, index), step), (2,), jnp.uint32
        )

    return jax.vmap(sample)(index, step).T
