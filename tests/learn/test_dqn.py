"""Deep Q-learning against numbers worked out by hand."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.network import make_network
from apollonius.learn import dqn, replay_buffer
from apollonius.learn.learner_config import DQNConfig

loss, update = (jax.jit(one, static_argnums=3) for one in (dqn.loss, dqn.update))
PLAIN = DQNConfig(double=False, averaging=0.25)


def table(values):
    """A network without hidden layers that reads off the rows of a table for one-hot observations."""
    layer = make_network("paper", width=1, depth=0, key=jax.random.key(0))
    weight = jnp.zeros((9, 8)).at[:, : len(values)].set(jnp.asarray(values, jnp.float32).T)
    return eqx.tree_at(lambda n: (n.layers[0].weight, n.layers[0].bias), layer, (weight, jnp.zeros(9)))


def one_hot(state):
    return jnp.eye(8)[jnp.asarray(state)]


def row(**values):
    """Nine action values, those not named being zero: `row(_2=5.0)`."""
    return [values.get(f"_{action}", 0.0) for action in range(9)]


@pytest.mark.parametrize(
    ("double", "next_value"),
    [(False, 6.0), (True, 4.0)],
    ids=["the target's own best action", "the action that the network likes best"],
)
def test_the_loss_is_the_mean_squared_error_of_the_chosen_actions(double, next_value):
    network = table([row(_3=2.0), row(_1=8.0)])
    target = table([row(), row(_1=4.0, _5=6.0)])
    batch = replay_buffer.Batch(
        observation=one_hot([0, 0]),
        action=jnp.array([3, 4]),
        reward=jnp.array([1.0, -10.0]),
        next_observation=one_hot([1, 1]),
        discount=jnp.array([0.5, 0.0]),
    )
    errors = [1.0 + 0.5 * next_value - 2.0, -10.0 - 0.0]
    assert loss(network, target, batch, double) == pytest.approx(np.mean(np.square(errors)))


def test_the_loss_has_no_gradient_through_the_target():
    """Only the chosen action's value moves, by -2 (target - value) / batch."""
    network = table([row(), row(_1=8.0)])
    batch = replay_buffer.Batch(one_hot([0]), jnp.array([3]), jnp.array([1.0]), one_hot([1]), jnp.array([0.5]))
    gradient = jax.jit(jax.grad(dqn.loss), static_argnums=3)(network, network, batch, True).layers[0].weight
    expected = np.zeros((9, 8))
    expected[3, 0] = -2 * (1.0 + 0.5 * 8.0)
    np.testing.assert_allclose(gradient, expected, atol=1e-6)


def test_an_update_is_one_step_of_adam():
    """Adam's first step is the step size against the gradient's sign, whatever the gradient's size."""
    learner = dqn.init(PLAIN, jax.random.key(0), table([row(_3=2.0)]))
    batch = replay_buffer.Batch(one_hot([0]), jnp.array([3]), jnp.array([100.0]), one_hot([1]), jnp.array([0.0]))
    after, error = update(learner, batch, jnp.asarray(0.01), PLAIN)
    assert error == pytest.approx(98.0**2)
    assert after.network(one_hot(0))[3] == pytest.approx(2.0 + 2 * 0.01, abs=1e-5)  # its weight and its bias
    assert after.average(one_hot(0))[3] == pytest.approx(2.0 + 0.25 * 2 * 0.01, abs=1e-5)
    assert after.updates == 1
    assert eqx.tree_equal(after.target, learner.target)
    assert eqx.tree_equal(dqn.copy_to_target(after, jnp.asarray(False)).target, learner.target)
    assert eqx.tree_equal(dqn.copy_to_target(after, jnp.asarray(True)).target, after.network)
