"""What a scheme of self-play decides: how many games a side has with earlier versions of the other, and with which."""

import importlib

import jax.numpy as jnp
from jaxtyping import Array, Float


class AbstractScheme:
    """A scheme; what it does not say is as in fictitious self-play, where every version is as likely as another.

    Attributes:
        share: share of the games with an earlier version, half of them of either side; None leaves it to the config.
        keeps_records: whether `weigh` looks at how versions fare against the other side's learner.
    """

    share: float | None = None
    keeps_records: bool = False

    def weigh(self, lost: Float[Array, " versions"]) -> Float[Array, " versions"]:
        """How likely a side's versions are to play, up to a factor. It is compiled.

        Args:
            lost: the share of its recent games that each version lost to the other side's learner.
        """
        return jnp.ones_like(lost)


def find_scheme(name: str) -> AbstractScheme:
    """The scheme of this name, one of `apollonius.learn.opponents.schemes.SCHEMES`."""
    return importlib.import_module(f"apollonius.learn.opponents.{name.replace('-', '_')}").SCHEME
