"""Work for the rows of a batch that need it, a few at a time.

A `vmap` of a condition does the work of all rows as long as one needs it.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int, PyTree


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
