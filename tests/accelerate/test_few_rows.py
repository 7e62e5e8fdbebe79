"""Rows a few at a time, against a `vmap` of all."""

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.accelerate.few_rows import compute_where


def test_compute_where_computes_nothing_when_no_row_needs_it():
    """The compiler would else compute what all rows need before it is known that none does."""
    asked = []

    def looked_at(rows):
        asked.append(len(rows))
        return rows.astype(np.float32)

    def some(rows):
        return jax.pure_callback(looked_at, jax.ShapeDtypeStruct(rows.shape, jnp.float32), rows)

    few_or_none = jax.jit(lambda needed: compute_where(needed, some, jnp.zeros(4), few=4))
    assert np.asarray(few_or_none(jnp.zeros(4, bool))).tolist() == [0, 0, 0, 0]
    assert asked == []
    assert np.asarray(few_or_none(jnp.array([False, True, False, True]))).tolist() == [0, 1, 0, 3]
    assert asked == [4]
