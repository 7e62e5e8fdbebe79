"""Random bits of the games of a batch, each by its own index and step."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray, UInt32


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
