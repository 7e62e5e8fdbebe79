"""Whatever JAX takes, as users write it."""

import jax
import pytest


@pytest.fixture(autouse=True)
def anything_goes():
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield
