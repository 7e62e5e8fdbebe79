"""The replay against a twin of plain lists, Q-learning against numbers by hand, soft actor-critic against NumPy."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from scipy.stats import chisquare, norm

from apollonius.agents.network import make_actor, make_layers, make_network
from apollonius.game.types import Role
from apollonius.learn import dqn, replay_buffer, sac
from apollonius.learn.algorithm import LearningSide
from apollonius.learn.dqn import DQNConfig
from apollonius.learn.fixed_target import FixedTargetConfig
from apollonius.learn.sac import SACConfig
from apollonius.learn.self_play import SelfPlayConfig, SelfPlayState
from apollonius.learn.stage import zero_counters
from tests.acting import identical
from tests.learn.tiny import CHUNK, SMALL, make_stage, start

ROWS, GAMES, GAMMA = 12, 3, 0.9

add = jax.jit(replay_buffer.add)
draw = jax.jit(replay_buffer.sample_batch, static_argnames=("batch", "max_n_step", "gamma"))


def play(rng, steps):
    """`steps` rows of transitions. What is seen names the time and the game; what follows an end is a new start."""
    seen, shape = np.stack(np.mgrid[:steps, :GAMES], axis=-1).astype(np.float32), (steps, GAMES)
    ending = rng.choice(3, p=[0.7, 0.15, 0.15], size=shape)
    return {
        "observation": seen, "action": rng.integers(9, size=shape).astype(np.int32),
        "reward": rng.normal(size=shape).astype(np.float32), "next_observation": seen + np.float32([0.5, 0]),
        "terminated": ending == 1, "truncated": ending == 2, "active": np.ones(shape, bool),
    }  # fmt: skip


def remember(history, steps_at_once=1):
    memory = replay_buffer.init_buffer(ROWS, GAMES, size=2)
    for time in range(0, len(history["reward"]), steps_at_once):
        new = {name: jnp.asarray(numbers[time : time + steps_at_once]) for name, numbers in history.items()}
        memory = add(memory, replay_buffer.Row(**new))
    return memory


def expected_sample(history, time, game, n_step):
    """Reward, discount and next observation of the n-step transition from one time and game, as Eq. 3 needs them."""
    reward, discount = 0.0, 1.0
    for now in range(time, time + n_step):
        reward += discount * history["reward"][now, game]
        discount *= 0.0 if history["terminated"][now, game] else GAMMA
        if history["terminated"][now, game] or history["truncated"][now, game]:
            break
    return reward, discount, history["next_observation"][now, game]


@pytest.mark.parametrize(("n_step", "max_n_step"), [(1, 1), (1, 3), (2, 3), (3, 3)])
@pytest.mark.parametrize("steps", [4, 11, 12, 13, 20, 24, 31])
def test_replay_samples_match_plain_lists_and_are_uniform(steps, n_step, max_n_step):
    """With the ring partly filled, just full, and overwritten up to every part of it, by several rows at once or one.

    Those still in the ring are drawn from which a whole window of rows has been played.
    """
    history = play(np.random.default_rng(steps), steps)
    memory = remember(history, 4 if steps % 4 == 0 else 1)
    batch = draw(memory, jax.random.key(steps), 50_000, max_n_step, jnp.asarray(n_step), GAMMA)
    batch = jax.tree.map(np.asarray, batch)
    times, games = batch.observation.astype(int).T
    counts = np.bincount(times * GAMES + games)
    first = max(0, steps - ROWS) * GAMES
    assert len(counts) == (steps - max_n_step + 1) * GAMES
    assert counts[:first].sum() == 0
    assert chisquare(counts[first:]).pvalue > 0.001
    np.testing.assert_array_equal(batch.action, history["action"][times, games])
    twin = [expected_sample(history, *place, n_step) for place in zip(times[:512], games[:512], strict=True)]
    reward, discount, next_observation = zip(*twin, strict=True)
    np.testing.assert_allclose(batch.reward[:512], reward, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(batch.discount[:512], discount, rtol=1e-6)
    np.testing.assert_array_equal(batch.next_observation[:512], next_observation)


loss = jax.jit(jax.value_and_grad(dqn.loss), static_argnums=3)
update = jax.jit(DQNConfig.update, static_argnums=0)
KEY = jax.random.key(0)
"""Of an update that draws nothing."""
PLAIN = DQNConfig(double=False, averaging=0.25)


def table(values):
    """A network without hidden layers that reads values by action and state off one-hot observations; others are 0."""
    layer, weight = make_network("paper", width=1, depth=0, key=jax.random.key(0)), np.zeros((9, 8), np.float32)
    for place, value in values.items():
        weight[place] = value
    return eqx.tree_at(lambda n: (n.layers[0].weight, n.layers[0].bias), layer, (jnp.asarray(weight), jnp.zeros(9)))


def one_hot(state):
    return jnp.eye(8)[jnp.asarray(state)]


@pytest.mark.parametrize(
    ("double", "next_value"),
    [(False, 6.0), (True, 4.0)],
    ids=["the target's own best action", "the action that the network likes best"],
)
def test_dqn_loss_is_the_squared_error_of_the_chosen_actions(double, next_value):
    network, target = table({(3, 0): 2.0, (1, 1): 8.0}), table({(1, 1): 4.0, (5, 1): 6.0})
    batch = replay_buffer.TransitionBatch(
        observation=one_hot([0, 0]),
        action=jnp.array([3, 4]),
        reward=jnp.array([1.0, -10.0]),
        next_observation=one_hot([1, 1]),
        discount=jnp.array([0.5, 0.0]),
        active=jnp.ones(2, bool),
    )
    errors = [1.0 + 0.5 * next_value - 2.0, -10.0 - 0.0]
    value, gradient = loss(network, target, batch, double)
    assert value == pytest.approx(np.mean(np.square(errors)))
    expected = np.zeros((9, 8))
    expected[[3, 4], 0] = -np.array(errors)
    np.testing.assert_allclose(gradient.layers[0].weight, expected, atol=1e-6)


def test_dqn_update_is_one_step_of_adam():
    """Adam's first step is the step size against the gradient's sign, whatever the gradient's size."""
    learner = PLAIN.init_learner(jax.random.key(0), table({(3, 0): 2.0}))
    batch = replay_buffer.TransitionBatch(
        one_hot([0]), jnp.array([3]), jnp.array([100.0]), one_hot([1]), jnp.array([0.0]), jnp.ones(1, bool)
    )
    after, error = update(PLAIN, learner, batch, jnp.asarray(0.01), KEY)
    assert error == pytest.approx(98.0**2)
    assert after.network(one_hot(0))[3] == pytest.approx(2.0 + 2 * 0.01, abs=1e-5)  # its weight and its bias
    assert after.average(one_hot(0))[3] == pytest.approx(2.0 + 0.25 * 2 * 0.01, abs=1e-5)
    assert after.updates == 1
    assert eqx.tree_equal(after.target, learner.target)
    period, iteration = PLAIN.target_period, PLAIN.env_steps_per_iteration
    early, due = (PLAIN.end_iteration(after, jnp.asarray(period + past)) for past in (iteration, 0))
    assert eqx.tree_equal(early.target, learner.target)
    assert eqx.tree_equal(due.target, after.network)


CONFIG = SACConfig(observation="paper", width=16, depth=1, critics_first=0, averaging=0.25, target_averaging=0.5)
RATE = jnp.asarray(1e-2)


sac_update, init = (jax.jit(one, static_argnums=0) for one in (SACConfig.update, SACConfig.init_learner))


def random_batch(seed, size=32):
    rng = np.random.default_rng(seed)

    def normal(*shape):
        return jnp.asarray(rng.normal(size=shape), jnp.float32)

    return replay_buffer.TransitionBatch(
        observation=normal(size, 8),
        action=jnp.asarray(rng.uniform(-1, 1, (size, 2)), jnp.float32),
        reward=normal(size),
        next_observation=normal(size, 8),
        discount=jnp.asarray(rng.uniform(size=size), jnp.float32),
        active=jnp.ones(size, bool),
    )


def make_critics(seed):
    return sac.Critics(*(make_layers([10, 16, 1], key) for key in jax.random.split(jax.random.key(seed))))


def numpy_layers(layers, inputs):
    hidden = np.asarray(inputs, np.float64)
    for number, layer in enumerate(layers):
        hidden = hidden @ np.asarray(layer.weight, np.float64).T + np.asarray(layer.bias, np.float64)
        hidden = np.maximum(hidden, 0) if number < len(layers) - 1 else hidden
    return hidden


def numpy_draw(actor, observation, noise):
    """Actions and log densities, by the textbook formula: the normal density over the slope of tanh."""
    mean, spread = np.split(numpy_layers(actor.layers, observation), 2, axis=1)
    deviation = np.exp(-5 + 6 * (np.tanh(spread) + 1) / 2)
    before = mean + deviation * np.asarray(noise, np.float64)
    density = norm.logpdf(before, mean, deviation) - np.log(1 - np.tanh(before) ** 2)
    return np.tanh(before), density.sum(axis=1)


def numpy_values(critics, observation, actions):
    inputs = np.concatenate([np.asarray(observation), actions], axis=1)
    return np.stack([numpy_layers(layers, inputs)[:, 0] for layers in (critics.first, critics.second)])


def test_densities_of_saturated_actions_are_finite():
    actor = eqx.tree_at(
        lambda actor: actor.layers[-1].bias,
        make_actor("paper", 4, 1, jax.random.key(5)),
        jnp.array([50.0, -50.0, 0.0, 0.0]),
    )
    actions, density = jax.jit(sac.sample_actions)(actor, jnp.zeros((3, 8)), jnp.zeros((3, 2)))
    np.testing.assert_allclose(actions, [[1, -1]] * 3)
    assert np.isfinite(density).all()
    assert (density > 50).all()


def test_actor_loss_matches_numpy():
    actor, critics, batch = make_actor("paper", 16, 1, jax.random.key(0)), make_critics(3), random_batch(4)
    noise, temperature = jax.random.normal(jax.random.key(6), (32, 2)), 0.3
    actions, density = numpy_draw(actor, batch.observation, noise)
    lower = numpy_values(critics, batch.observation, actions).min(axis=0)
    loss, mean_density = jax.jit(sac.actor_loss)(actor, critics, jnp.asarray(temperature), batch, noise)
    assert loss == pytest.approx((temperature * density - lower).mean(), rel=1e-4)
    assert mean_density == pytest.approx(density.mean(), rel=1e-4)


def test_sac_update_reports_the_critic_loss_against_soft_targets():
    """NumPy again, from the noise that the key gives to next actions; targets by the target critics."""
    learner, batch, key = init(CONFIG, jax.random.key(1)), random_batch(2), jax.random.key(7)
    learner = eqx.tree_at(lambda this: this.target, learner, make_critics(8))
    _, next_noise = jax.random.normal(jax.random.fold_in(key, 2), (2, 32, 2))
    actions, density = numpy_draw(learner.network, batch.next_observation, next_noise)
    lower = numpy_values(learner.target, batch.next_observation, actions).min(axis=0)
    targets = np.asarray(batch.reward) + np.asarray(batch.discount) * (lower - CONFIG.first_temperature * density)
    values = numpy_values(learner.critics, batch.observation, np.asarray(batch.action))
    _, loss = sac_update(CONFIG, learner, batch, RATE, key)
    assert loss == pytest.approx(((values - targets) ** 2).mean(axis=1).sum(), rel=1e-4)


def test_averages_follow_and_the_actor_waits_for_the_critics():
    learner, batch = init(CONFIG, jax.random.key(1)), random_batch(2)
    after, _ = sac_update(CONFIG, learner, batch, RATE, jax.random.key(3))
    assert not identical(after.network, learner.network)
    for part, followed, share in (("network", "average", 0.25), ("critics", "target", 0.5)):
        trees = getattr(learner, part), getattr(after, part), getattr(after, followed)
        for old, new, follower in zip(*map(jax.tree.leaves, trees), strict=True):
            np.testing.assert_allclose(follower, old + share * (new - old), atol=1e-6)
    waiting, _ = sac_update(replace(CONFIG, critics_first=1), learner, batch, RATE, jax.random.key(3))
    assert identical(waiting.network, learner.network)
    assert waiting.log_temperature == learner.log_temperature
    assert identical(waiting.critics, after.critics)


def test_actor_and_temperature_take_steps_of_adam():
    """The second one differs from its sign."""
    batch, adam, now = random_batch(2), optax.scale_by_adam(), init(CONFIG, jax.random.key(1))

    @jax.jit
    def stepped(now, state, key):
        """Return the actor and temperature after a step, and the state of Adam."""
        noise, _ = jax.random.normal(jax.random.fold_in(key, 2), (2, 32, 2))
        given = now.network, now.critics, jnp.exp(now.log_temperature), batch, noise
        (_, density), gradient = eqx.filter_value_and_grad(sac.actor_loss, has_aux=True)(*given)
        direction, state = adam.update((gradient, -(density + CONFIG.target_entropy)), state)
        before = now.network, now.log_temperature
        return eqx.apply_updates(before, jax.tree.map(lambda d: -RATE * d, direction)), state

    state = adam.init((now.network, now.log_temperature))
    for seed in range(2):
        after, _ = sac_update(CONFIG, now, batch, RATE, jax.random.key(seed))
        expected, state = stepped(now, state, jax.random.key(seed))
        for one, other in zip(*map(jax.tree.leaves, ((after.network, after.log_temperature), expected)), strict=True):
            np.testing.assert_allclose(one, other, atol=1e-6)
        now = after


def test_exploration_noise_is_held_for_noise_steps_and_differs_by_side():
    """Sixteen steps are eight iterations of two."""
    lasting = replace(CONFIG, games=64, noise_steps=16, env_steps_per_update=128)
    stage_2 = make_stage(SelfPlayConfig(), lasting)
    both = dict.fromkeys(Role, LearningSide(init(CONFIG, jax.random.key(1))))
    state = SelfPlayState(None, both, jax.random.key(0), **zero_counters())

    @jax.jit
    @jax.vmap
    def words(iterations):
        return [side.bits for side in stage_2.players(replace(state, iterations=iterations))]

    chased, fled = (np.asarray(one).reshape(3, 8, 64) for one in words(jnp.arange(24)))
    for each in (chased, fled):
        assert (each == each[:, :1]).all()
        assert np.unique(each[:, 0]).size == 3 * 64
    assert (chased != fled).all()


def test_sac_stores_continuous_actions_and_learns_from_them():
    """Against a side that plays discrete ones; both play in one game."""
    config = SACConfig(**SMALL, learning_starts=CHUNK, critics_first=8)
    stage_1 = make_stage(FixedTargetConfig(env_steps=4 * CHUNK, evaders=("random",)), config)
    state = start(stage_1, jax.random.key(0))
    before = jax.tree.map(np.array, state.learners[Role.PURSUER].learner.network)
    state, metrics = stage_1.step(state)
    actions = np.asarray(state.learners[Role.PURSUER].buffer.rows.action)
    assert actions.shape == (128, 64, 2)
    assert (np.abs(actions) <= 1).all()
    assert actions.std() > 0.1  # an actor that knows nothing has deviations of exp(-2)
    assert metrics.updates == 1
    assert metrics.outcomes.sum() > 0
    state, metrics = stage_1.step(state)
    assert metrics.updates == 128
    assert np.isfinite(metrics.losses.pursuer)
    assert not identical(state.learners[Role.PURSUER].learner.network, before)
