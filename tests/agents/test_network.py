"""The network: a batch of observations has the values of each, and the gradient that differentiation would make."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.network import make_network

NETWORK = make_network("encoded", 16, 3, jax.random.key(0))
SEEN = jax.random.normal(jax.random.key(1), (40, 17))
WANTED = jax.random.normal(jax.random.key(2), (40, 9))


def one_by_one(network, seen):
    return jax.vmap(network)(seen)


def together(network, seen):
    return network.batch(seen)


def error(values):
    return lambda network, seen: jnp.mean((values(network, seen) - WANTED) ** 2)


def test_a_batch_has_the_values_of_each_observation():
    values = together(NETWORK, SEEN)
    assert values.shape == (40, 9)
    np.testing.assert_allclose(values, one_by_one(NETWORK, SEEN), atol=1e-6)


@pytest.mark.parametrize("of", ["weights", "observations"])
def test_its_gradient_is_that_of_the_same_values(of):
    if of == "weights":
        slopes = [eqx.filter_grad(error(values))(NETWORK, SEEN) for values in (together, one_by_one)]
    else:
        slopes = [jax.grad(error(values), argnums=1)(NETWORK, SEEN) for values in (together, one_by_one)]
    mine, theirs = map(jax.tree.leaves, slopes)
    assert len(mine) == (8 if of == "weights" else 1)
    for one, other in zip(mine, theirs, strict=True):
        assert np.abs(other).max() > 1e-4
        np.testing.assert_allclose(one, other, atol=1e-7, rtol=1e-4)
