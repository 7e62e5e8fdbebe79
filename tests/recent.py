"""A new scheme of self-play: the latest versions are the likeliest. `docs/extending.md` shows this file."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.learn.opponents.scheme import AbstractScheme


class Recent(AbstractScheme):
    """A version is twice as likely as the one that was kept before it."""

    def weigh(self, lost: Float[Array, " versions"]) -> Float[Array, " versions"]:
        """By how late it was kept; versions are numbered in that order."""
        return jnp.exp2(jnp.arange(lost.shape[0], dtype=jnp.float32))


SCHEME = Recent()
