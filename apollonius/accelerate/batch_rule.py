"""A function whose `vmap` is computed by a second function, for all rows at once."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_batching import custom_vmap

BatchFunction = Callable[..., Any]
"""Takes the number of rows, for each leaf of the arguments whether it has an axis of rows, and the
arguments.
"""


def with_batch_function(
    together: BatchFunction,
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator by which a `vmap` of a function is computed by `together`.

    The function's first argument is a player. If the players differ from row to row as well, the
    `vmap` stays an ordinary one.
    """

    def decorate(single: Callable[..., Any]) -> Callable[..., Any]:
        function = custom_vmap(single)

        def in_rows(size: int, batched: Sequence[Any], *arguments: Any) -> tuple[Any, Any]:
            if any(jax.tree.leaves(batched[0])):
                axes = jax.tree.map(lambda has: 0 if has else None, tuple(batched))
                results = jax.vmap(single, in_axes=axes, axis_size=size)(*arguments)
            else:
                results = together(size, batched, *arguments)
            return results, jax.tree.map(lambda _: True, results)

        function.def_vmap(in_rows)
        return function

    return decorate


def broadcast_rows(size: int, batched: Any, tree: Any) -> Any:
    """Return arguments whose leaves all have the axis of rows."""

    def in_rows(leaf: Any, has_rows: bool) -> Any:
        return leaf if has_rows else jnp.broadcast_to(leaf, (size, *jnp.shape(leaf)))

    return jax.tree.map(in_rows, tree, batched)
