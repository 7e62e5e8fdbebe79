"""The network: a batch of observations has the values of each, and the gradient that differentiation would make."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.greedy import EpsilonGreedy, SquashedGaussian
from apollonius.agents.network import make_actor, make_network
from apollonius.agents.pool import solo
from tests.acting import act, act_in_rows

NETWORK = make_network("encoded", 16, 3, jax.random.key(0))
SEEN = jnp.asarray(np.random.default_rng(1).normal(size=(40, 17)).astype(np.float32))
WANTED = jnp.asarray(np.random.default_rng(2).normal(size=(40, 9)).astype(np.float32))


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


@pytest.mark.parametrize("games", [64, 40], ids=["whole blocks", "fewer"])
@pytest.mark.parametrize("kind", ["discrete", "continuous"])
def test_players_of_many_games_act_as_each_of_them_would(kind, games):
    """Quicker ways through the network are taken for whole blocks only."""
    if kind == "discrete":
        player = EpsilonGreedy(make_network("encoded", 64, 2, jax.random.key(0)), jnp.float32(0.3))
    else:
        player = SquashedGaussian(make_actor("encoded", 64, 2, jax.random.key(0)), jnp.float32(1.0))
    seen = jax.random.normal(jax.random.key(1), (games, 17))
    bits = jax.random.bits(jax.random.key(2), (games,), jnp.uint32)
    together = jax.jit(act_in_rows)(solo(player), jnp.zeros(games, jnp.int32), seen, bits)
    alone = jax.jit(act)
    each = np.stack([alone(player, *one) for one in zip(seen, bits, strict=True)])
    assert len(np.unique(each, axis=0)) > 5
    np.testing.assert_allclose(together, each, atol=1e-6)
