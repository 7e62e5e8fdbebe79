"""How the tests of experiments run."""

import jax
import pytest


@pytest.fixture(autouse=True, scope="package")
def promotion_as_optax_needs_it():
    """Adam in optax raises a float to an integer power."""
    with jax.numpy_dtype_promotion("standard"):
        yield
