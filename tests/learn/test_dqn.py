"""Deep Q-learning against hand numbers, against rlax, and on a chain whose action values are known."""

import warnings

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
DOUBLE = DQNConfig(double=True, averaging=0.25)


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


def random_batch(rng, size=32):
    def normal(*shape):
        return jnp.asarray(rng.normal(size=shape), jnp.float32)

    return replay_buffer.Batch(
        observation=normal(size, 8),
        action=jnp.asarray(rng.integers(9, size=size), jnp.int32),
        reward=normal(size),
        next_observation=normal(size, 8),
        discount=jnp.asarray(rng.uniform(size=size), jnp.float32),
    )


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


@pytest.mark.parametrize("config", [PLAIN, DOUBLE], ids=["plain", "double"])
def test_targets_and_loss_agree_with_rlax(config):
    with warnings.catch_warnings(), jax.numpy_rank_promotion("allow"):
        warnings.simplefilter("ignore")
        rlax = pytest.importorskip("rlax")
        network, target = (make_network("paper", 16, 1, jax.random.key(seed)) for seed in (1, 2))
        batch = random_batch(np.random.default_rng(3))
        values, next_values = jax.vmap(network)(batch.observation), jax.vmap(target)(batch.next_observation)
        next_choice = jax.vmap(network)(batch.next_observation)
        if config.double:
            errors = jax.vmap(rlax.double_q_learning)(
                values, batch.action, batch.reward, batch.discount, next_values, next_choice
            )
        else:
            errors = jax.vmap(rlax.q_learning)(values, batch.action, batch.reward, batch.discount, next_values)
    assert loss(network, target, batch, config.double) == pytest.approx(float(jnp.mean(errors**2)), rel=1e-5)


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
    assert after.updates == 1
    assert eqx.tree_equal(after.target, learner.target)


# A chain of five states. Actions 0-4 go left (and stay at the left end), 5-8 go right; going right from the last state
# ends the game and pays 1, every other step costs 0.1. Games are cut off after seven steps and begin anywhere.
STATES, LEFT_ACTIONS, TIME_LIMIT, GAMMA = 5, 5, 7, 0.9


def chain_step(state, action):
    if action < LEFT_ACTIONS:
        return max(state - 1, 0), -0.1, False
    return (state, 1.0, True) if state == STATES - 1 else (state + 1, -0.1, False)


def chain_values():
    """The exact action values, by value iteration. There is no time limit in them."""
    values = np.zeros((STATES, 9))
    for _ in range(500):
        for state in range(STATES):
            for action in range(9):
                after, reward, over = chain_step(state, action)
                values[state, action] = reward + (0 if over else GAMMA * values[after].max())
    return values


def chain_replay(steps=400, games=8):
    """The replay of random play."""
    rng = np.random.default_rng(0)
    memory = replay_buffer.init(steps, games, 8, replay_buffer.DISCRETE)
    state, age = rng.integers(STATES, size=games), np.zeros(games, int)
    rows = []
    for _ in range(steps):
        action = rng.integers(9, size=games)
        after, reward, terminated = (np.array(part) for part in zip(*map(chain_step, state, action), strict=True))
        age += 1
        truncated = (age == TIME_LIMIT) & ~terminated
        rows.append((state, action, reward, after, terminated, truncated))
        over = terminated | truncated
        state, age = np.where(over, rng.integers(STATES, size=games), after), np.where(over, 0, age)
    state, action, reward, after, terminated, truncated = (np.stack(part) for part in zip(*rows, strict=True))
    assert truncated.sum() > 100
    return replay_buffer.add(
        memory,
        replay_buffer.Row(
            one_hot(state),
            jnp.asarray(action, jnp.int32),
            jnp.asarray(reward, jnp.float32),
            one_hot(after),
            jnp.asarray(terminated),
            jnp.asarray(truncated),
        ),
    )


def test_a_chain_is_solved_and_its_time_limit_is_not_taken_for_an_end():
    memory = chain_replay()
    learner = dqn.init(DQNConfig(observation="paper", width=32, depth=1), jax.random.key(0))

    @jax.jit
    def learn(learner):
        def one_update(learner, step):
            key = jax.random.fold_in(jax.random.key(1), step)
            batch = replay_buffer.sample(memory, key, batch=64, max_n_step=1, n_step=1, gamma=GAMMA)
            rate = jnp.where(step < 3000, 3e-3, 3e-4)
            learner, loss = dqn.update(learner, batch, rate, PLAIN)
            return dqn.copy_to_target(learner, step % 50 == 0), loss

        return jax.lax.scan(one_update, learner, jnp.arange(5000))[0]

    learner = learn(learner)
    assert learner.updates == 5000
    for network in (learner.network, learner.average):
        np.testing.assert_allclose(jax.vmap(network)(one_hot(np.arange(STATES))), chain_values(), atol=0.02)
