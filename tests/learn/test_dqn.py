"""The replay against a twin that keeps plain lists, and deep Q-learning against numbers worked out by hand."""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chisquare

from apollonius.agents.network import make_network
from apollonius.learn import dqn, replay_buffer
from apollonius.learn.learner_config import DQNConfig

ROWS, GAMES, GAMMA = 12, 3, 0.9

add = jax.jit(replay_buffer.add)
draw = jax.jit(replay_buffer.sample, static_argnames=("batch", "max_n_step", "gamma"))


@dataclass
class Transition:
    observation: tuple[float, float]
    action: int
    reward: float
    next_observation: tuple[float, float]
    terminated: bool
    truncated: bool


def play(rng, steps):
    """`steps` rows of transitions. What is seen names the time and the game; what follows an end is a new start."""

    def one(time, game):
        ending = rng.choice(["goes on", "terminated", "truncated"], p=[0.7, 0.15, 0.15])
        return Transition(
            observation=(time, game),
            action=int(rng.integers(9)),
            reward=float(np.float32(rng.normal())),
            next_observation=(time + 0.5, game),
            terminated=bool(ending == "terminated"),
            truncated=bool(ending == "truncated"),
        )

    return [[one(time, game) for game in range(GAMES)] for time in range(steps)]


def as_rows(history):
    def leaf(name, dtype):
        return jnp.asarray(np.array([[getattr(one, name) for one in row] for row in history], dtype))

    return replay_buffer.Row(
        observation=leaf("observation", np.float32),
        action=leaf("action", np.int32),
        reward=leaf("reward", np.float32),
        next_observation=leaf("next_observation", np.float32),
        terminated=leaf("terminated", bool),
        truncated=leaf("truncated", bool),
    )


def remember(history, steps_at_once=1):
    memory = replay_buffer.init(ROWS, GAMES, size=2, action=replay_buffer.DISCRETE)
    for time in range(0, len(history), steps_at_once):
        memory = add(memory, as_rows(history[time : time + steps_at_once]))
    return memory


def sample(memory, seed, batch, n_step, max_n_step=None):
    drawn = draw(memory, jax.random.key(seed), batch, max_n_step or n_step, jnp.asarray(n_step), GAMMA)
    return jax.tree.map(np.asarray, drawn)


def expected_sample(history, time, game, n_step):
    """Reward, discount and next observation of the n-step transition from one time and game, as Eq. 3 needs them."""
    reward, discount = 0.0, 1.0
    for one in (row[game] for row in history[time : time + n_step]):
        reward += discount * one.reward
        discount *= 0.0 if one.terminated else GAMMA
        if one.terminated or one.truncated:
            break
    return reward, discount, one.next_observation


def kept_starts(steps, window):
    """Times still in the ring from which a whole window of rows has been played."""
    return range(max(0, steps - ROWS), steps - window + 1)


@pytest.mark.parametrize(("n_step", "max_n_step"), [(1, 1), (1, 3), (2, 3), (3, 3)])
@pytest.mark.parametrize("steps", [4, 11, 12, 13, 20, 24, 31])
def test_samples_are_what_the_twin_says(steps, n_step, max_n_step):
    """With the ring partly filled, just full, and overwritten up to every part of it."""
    history = play(np.random.default_rng(steps), steps)
    batch = sample(remember(history), seed=steps, batch=512, n_step=n_step, max_n_step=max_n_step)
    times, games = batch.observation.astype(int).T
    assert set(times) == set(kept_starts(steps, max_n_step))
    assert set(games) == set(range(GAMES))
    for index, (time, game) in enumerate(zip(times, games, strict=True)):
        reward, discount, next_observation = expected_sample(history, time, game, n_step)
        assert batch.action[index] == history[time][game].action
        np.testing.assert_allclose(batch.reward[index], reward, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(batch.discount[index], discount, rtol=1e-6)
        assert tuple(batch.next_observation[index].tolist()) == next_observation


def test_rows_added_together_are_rows_added_one_by_one():
    history = play(np.random.default_rng(0), 20)
    one_by_one, together = remember(history, 1), remember(history, 4)
    assert jax.tree.all(jax.tree.map(np.array_equal, one_by_one, together))


def test_every_kept_transition_is_equally_likely():
    steps, n_step = 17, 3
    memory = remember(play(np.random.default_rng(1), steps))
    batch = sample(memory, seed=0, batch=50_000, n_step=n_step)
    times, games = batch.observation.astype(int).T
    counts = [np.sum((times == time) & (games == game)) for time in kept_starts(steps, n_step) for game in range(GAMES)]
    assert sum(counts) == 50_000
    assert chisquare(counts).pvalue > 0.01


def test_only_games_that_are_broken_off_are_cut_and_only_where_they_go_on():
    """In the latest row the first of three games was ended by the rules and the last one by the time limit."""
    history = play(np.random.default_rng(5), ROWS + 3)
    for game, (terminated, truncated) in enumerate([(True, False), (False, False), (False, True)]):
        history[-1][game].terminated, history[-1][game].truncated = terminated, truncated
    memory = remember(history)
    latest = (int(memory.head) - 1) % ROWS
    for broken_off, expected in (
        ([True, True, True], [False, True, True]),
        ([True, False, False], [False, False, True]),
        ([False, True, False], [False, True, True]),
    ):
        cut = replay_buffer.cut(memory, jnp.array(broken_off))
        assert np.asarray(cut.rows.truncated[latest]).tolist() == expected
        others = np.arange(ROWS) != latest
        np.testing.assert_array_equal(cut.rows.truncated[others], memory.rows.truncated[others])
        np.testing.assert_array_equal(cut.rows.terminated, memory.rows.terminated)


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
