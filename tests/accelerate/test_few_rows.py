"""Rows a few at a time, against a `vmap` of all."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.accelerate.few_rows import advance_open, compute_where


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


@pytest.mark.parametrize("few", [1, 4, 64])
def test_advance_open_matches_a_vmap_of_a_loop(few):
    """Collatz's rule until 1: from 1 nothing is done, from 27 it takes 111 steps."""
    numbers = jnp.arange(1, 31)

    def is_open(number):
        return number != 1

    def next_number(number):
        return jnp.where(number % 2 == 0, number // 2, 3 * number + 1)

    def advance(rows, pairs):
        number, steps = pairs
        return next_number(number), steps + rows + 1

    def alone(row, number):
        def one_step(pair):
            return next_number(pair[0]), pair[1] + row + 1

        return jax.lax.while_loop(lambda pair: is_open(pair[0]), one_step, (number, 0))

    rows = jnp.arange(30)
    together = advance_open((numbers, jnp.zeros(30, int)), lambda pair: is_open(pair[0]), advance, few)
    for mine, own in zip(together, jax.vmap(alone)(rows, numbers), strict=True):
        np.testing.assert_array_equal(mine, own)
    assert together[1][26] == 111 * 27
