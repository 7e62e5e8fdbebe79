"""A boundary that the compiler does not fuse across."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import jax
from jax.experimental.xla_metadata import set_xla_metadata

P = ParamSpec("P")
R = TypeVar("R")


def fusion_barrier(function: Callable[P, R]) -> Callable[P, R]:
    """Return a function whose inputs and outputs are computed once and stored when it is compiled.

    XLA on the CPU otherwise computes an intermediate result again for each of its uses: without
    this boundary a step of the game takes 46 cosines instead of 2 and runs ten times slower.
    (`optimization_barrier` does not help there.) Inside, all is fused as usual: the boundary is not
    handed on to the compiled functions that are called there, such as `jnp.where` and `jnp.clip`,
    each of which would else go through memory on its own.
    """

    @jax.jit
    def compiled(*args: P.args, **kwargs: P.kwargs) -> R:
        with set_xla_metadata(inlineable="true"):
            return function(*args, **kwargs)

    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        with set_xla_metadata(inlineable="false"):
            return compiled(*args, **kwargs)

    return call
