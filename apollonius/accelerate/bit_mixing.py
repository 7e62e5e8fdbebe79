"""Random bits from others and a number: by a hash, at less cost than a key of JAX."""

import jax.numpy as jnp
from jaxtyping import Array, UInt32


def mix_bits(
    bits: UInt32[Array, "*rows"], number: UInt32[Array, "*numbers"]
) -> UInt32[Array, "..."]:
    """Mix a number into random bits: a step of the golden ratio and the finaliser of MurmurHash3
    (Appleby, 2011).
    """
    words = bits + number * jnp.uint32(0x9E3779B9)
    words = (words ^ (words >> 16)) * jnp.uint32(0x85EBCA6B)
    words = (words ^ (words >> 13)) * jnp.uint32(0xC2B2AE35)
    return words ^ (words >> 16)
