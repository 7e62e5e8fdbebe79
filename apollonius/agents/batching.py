"""Functions of a player and what it sees that have a quicker form for a batch than a `vmap`."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_batching import custom_vmap
from jaxtyping import Array, Bool, Int, PyTree

Together = Callable[..., Any]
"""Takes the number of rows, for each leaf of the arguments whether it has an axis of rows, and the arguments."""


def batched_by(together: Together) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return the decorator of a function whose first argument is a player: a `vmap` over the others is `together`.

    Where players differ from row to row as well, a `vmap` remains what it is.
    """

    def decorate(alone: Callable[..., Any]) -> Callable[..., Any]:
        function = custom_vmap(alone)

        def in_rows(size: int, batched: Sequence[Any], *given: Any) -> tuple[Any, Any]:
            if any(jax.tree.leaves(batched[0])):
                axes = jax.tree.map(lambda has: 0 if has else None, tuple(batched))
                made = jax.vmap(alone, in_axes=axes, axis_size=size)(*given)
            else:
                made = together(size, batched, *given)
            return made, jax.tree.map(lambda _: True, made)

        function.def_vmap(in_rows)
        return function

    return decorate


def spread(size: int, batched: Any, tree: Any) -> Any:
    """Return arguments whose leaves all have the axis of rows."""
    return jax.tree.map(
        lambda leaf, has: leaf if has else jnp.broadcast_to(leaf, (size, *jnp.shape(leaf))), tree, batched
    )


def where_needed(
    needed: Bool[Array, " rows"], some: Callable[[Int[Array, " few"]], PyTree[Array]], others: PyTree[Array], few: int
) -> PyTree[Array]:
    """Return the results of a function for the rows that need it, `few` at a time, and given values for all others."""
    rows = needed.shape[0]
    (which,) = jnp.nonzero(needed, size=rows + -rows % few, fill_value=rows)

    def more(carry: tuple[Int[Array, ""], PyTree[Array]]) -> tuple[Int[Array, ""], PyTree[Array]]:
        done, made = carry
        # One slice of all rows would not depend on the loop, and what it costs be paid where no row needs it.
        theirs, _ = jax.lax.optimization_barrier((jax.lax.dynamic_slice(which, (done,), (few,)), done))
        new = some(jnp.minimum(theirs, rows - 1))
        return done + few, jax.tree.map(lambda all_, one: all_.at[theirs].set(one, mode="drop"), made, new)

    count = jnp.sum(needed, dtype=jnp.int32)
    return jax.lax.while_loop(lambda carry: carry[0] < count, more, (jnp.zeros((), jnp.int32), others))[1]
