"""Random bits, the same as those of `jax.random.bits`, in one pass.

On the CPU, JAX computes its hash by a loop of five groups of rounds, each of which reads and writes
memory. Here they are unrolled, so that each number is computed in one pass.
"""

import functools
import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, PRNGKeyArray, UInt32

from apollonius.accelerate.fusion_barrier import fusion_barrier

_PARTITIONABLE = "jax_threefry_partitionable"
"""JAX's setting for how it counts the words of a key."""
_PARITY = 0x1BD11BDA
_ROTATIONS = ((13, 15, 26, 6), (17, 29, 16, 24))
_GROUPS = 5


def threefry_bits(key: PRNGKeyArray, shape: tuple[int, ...]) -> UInt32[Array, "..."]:
    """Return random bits: `jax.random.bits(key, shape, "uint32")`, bit by bit, fewer than 2^32
    words.
    """
    is_partitionable = getattr(jax.config, _PARTITIONABLE)
    if jax.random.key_impl(key) != "threefry2x32" or not is_partitionable:
        return jax.random.bits(key, shape, jnp.uint32)
    return fusion_barrier(functools.partial(_words, shape))(jax.random.key_data(key))


def _words(shape: tuple[int, ...], key: UInt32[Array, "2"]) -> UInt32[Array, "..."]:
    """Return the words of a key: Threefry-2x32 with 20 rounds (Salmon et al., 2011)."""
    counter = jnp.arange(math.prod(shape), dtype=jnp.uint32).reshape(shape)
    keys = (key[0], key[1], key[0] ^ key[1] ^ jnp.uint32(_PARITY))
    high, low = jnp.full_like(counter, keys[0]), counter + keys[1]
    for group in range(_GROUPS):
        for rotation in _ROTATIONS[group % 2]:
            high = high + low
            low = high ^ ((low << rotation) | (low >> (32 - rotation)))
        high = high + keys[(group + 1) % 3]
        low = low + keys[(group + 2) % 3] + jnp.uint32(group + 1)
    return high ^ low
