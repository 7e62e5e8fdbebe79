"""Functions of a player and what it sees that have a quicker form for a batch than a `vmap`."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_batching import custom_vmap
from jaxtyping import Array, Bool, Int, PyTree

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


def compute_where(
    needed: Bool[Array, " rows"],
    some: Callable[[Int[Array, " few"]], PyTree[Array]],
    defaults: PyTree[Array],
    few: int,
) -> PyTree[Array]:
    """Compute values for the rows that need it, a few at a time.

    Args:
        needed: the rows that need it.
        some: the function, from the numbers of a few rows to their values.
        defaults: the values of the rows that do not need it, leaves `[rows, ...]`.
        few: number of rows at a time.
    """
    rows = needed.shape[0]
    (order,) = jnp.nonzero(needed, size=rows + -rows % few, fill_value=rows)

    def one_block(
        carry: tuple[Int[Array, ""], PyTree[Array]],
    ) -> tuple[Int[Array, ""], PyTree[Array]]:
        first, values = carry
        # Without the barrier XLA hoists work out of the loop, and it is paid where no row needs it.
        numbers, _ = jax.lax.optimization_barrier(
            (jax.lax.dynamic_slice(order, (first,), (few,)), first)
        )
        new = some(jnp.minimum(numbers, rows - 1))
        return first + few, jax.tree.map(
            lambda all_, new_leaf: all_.at[numbers].set(new_leaf, mode="drop"), values, new
        )

    count = jnp.sum(needed, dtype=jnp.int32)
    return jax.lax.while_loop(
        lambda carry: carry[0] < count, one_block, (jnp.zeros((), jnp.int32), defaults)
    )[1]
