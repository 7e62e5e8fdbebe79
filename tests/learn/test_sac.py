"""Soft actor-critic against a plain NumPy twin, densities against numerical ones, and training with it."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from scipy.stats import norm

from apollonius.agents.classical import Uniform
from apollonius.agents.network import make_actor, make_layers
from apollonius.agents.pool import solo
from apollonius.game.types import Role
from apollonius.learn import replay_buffer, sac
from apollonius.learn.learner_config import SACConfig
from apollonius.learn.loop import play_and_learn
from apollonius.learn.stage_config import Plan, SelfPlayConfig, StageConfig
from apollonius.learn.train_state import start
from tests.learn.tiny import CHUNK, GAME, SMALL

CONFIG = SACConfig(observation="paper", width=16, depth=1, critics_first=0, averaging=0.25, target_averaging=0.5)
RATE = jnp.asarray(1e-2)


update = jax.jit(sac.update, static_argnames="config")
init = jax.jit(sac.init, static_argnames="config")
sample, actor_loss = jax.jit(sac.sample), jax.jit(sac.actor_loss)


def random_batch(seed, size=32):
    rng = np.random.default_rng(seed)

    def normal(*shape):
        return jnp.asarray(rng.normal(size=shape), jnp.float32)

    return replay_buffer.Batch(
        observation=normal(size, 8),
        action=jnp.asarray(rng.uniform(-1, 1, (size, 2)), jnp.float32),
        reward=normal(size),
        next_observation=normal(size, 8),
        discount=jnp.asarray(rng.uniform(size=size), jnp.float32),
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


def test_actions_and_densities_are_those_of_the_textbook():
    actor, batch = make_actor("paper", 16, 1, jax.random.key(0)), random_batch(1)
    noise = jax.random.normal(jax.random.key(2), (32, 2))
    actions, density = sample(actor, batch.observation, noise)
    expected = numpy_draw(actor, batch.observation, noise)
    np.testing.assert_allclose(actions, expected[0], atol=1e-5)
    np.testing.assert_allclose(density, expected[1], atol=1e-4)


def test_far_out_densities_are_finite():
    actor = eqx.tree_at(
        lambda actor: actor.layers[-1].bias,
        make_actor("paper", 4, 1, jax.random.key(5)),
        jnp.array([50.0, -50.0, 0.0, 0.0]),
    )
    actions, density = sample(actor, jnp.zeros((3, 8)), jnp.zeros((3, 2)))
    np.testing.assert_allclose(actions, [[1, -1]] * 3)
    assert np.isfinite(density).all()
    assert (density > 50).all()


def test_the_actors_loss_agrees_with_numpy():
    actor, critics, batch = make_actor("paper", 16, 1, jax.random.key(0)), make_critics(3), random_batch(4)
    noise, temperature = jax.random.normal(jax.random.key(6), (32, 2)), 0.3
    actions, density = numpy_draw(actor, batch.observation, noise)
    lower = numpy_values(critics, batch.observation, actions).min(axis=0)
    loss, mean_density = actor_loss(actor, critics, jnp.asarray(temperature), batch, noise)
    assert loss == pytest.approx((temperature * density - lower).mean(), rel=1e-4)
    assert mean_density == pytest.approx(density.mean(), rel=1e-4)


def test_an_update_reports_the_critics_loss_against_soft_targets():
    """NumPy again, from the noise that the key gives to next actions; targets by the target critics."""
    learner, batch, key = init(CONFIG, jax.random.key(1)), random_batch(2), jax.random.key(7)
    learner = eqx.tree_at(lambda this: this.target, learner, make_critics(8))
    _, next_noise = jax.random.normal(key, (2, 32, 2))
    actions, density = numpy_draw(learner.network, batch.next_observation, next_noise)
    lower = numpy_values(learner.target, batch.next_observation, actions).min(axis=0)
    targets = np.asarray(batch.reward) + np.asarray(batch.discount) * (lower - CONFIG.first_temperature * density)
    values = numpy_values(learner.critics, batch.observation, np.asarray(batch.action))
    _, loss = update(learner, batch, key, RATE, config=CONFIG)
    assert loss == pytest.approx(((values - targets) ** 2).mean(axis=1).sum(), rel=1e-4)


def same(one, other):
    return bool(eqx.tree_equal(one, other))


def test_averages_follow_and_the_actor_waits_for_its_critics():
    learner, batch = init(CONFIG, jax.random.key(1)), random_batch(2)
    after, _ = update(learner, batch, jax.random.key(3), RATE, config=CONFIG)
    assert not same(after.network, learner.network)
    for old, new, average in zip(
        *(jax.tree.leaves(tree) for tree in (learner.network, after.network, after.average)), strict=True
    ):
        np.testing.assert_allclose(average, old + 0.25 * (new - old), atol=1e-6)
    for old, new, target in zip(
        *(jax.tree.leaves(tree) for tree in (learner.critics, after.critics, after.target)), strict=True
    ):
        np.testing.assert_allclose(target, old + 0.5 * (new - old), atol=1e-6)
    waiting, _ = update(learner, batch, jax.random.key(3), RATE, config=replace(CONFIG, critics_first=1))
    assert same(waiting.network, learner.network)
    assert waiting.log_temperature == learner.log_temperature
    assert same(waiting.critics, after.critics)


def test_actor_and_temperature_take_steps_of_adam():
    """The second one differs from its sign."""
    batch, adam, now = random_batch(2), optax.scale_by_adam(), init(CONFIG, jax.random.key(1))

    @jax.jit
    def stepped(now, state, key):
        """Return the actor and temperature after a step, and the state of Adam."""
        noise, _ = jax.random.normal(key, (2, 32, 2))
        given = now.network, now.critics, jnp.exp(now.log_temperature), batch, noise
        (_, density), gradient = eqx.filter_value_and_grad(sac.actor_loss, has_aux=True)(*given)
        direction, state = adam.update((gradient, -(density + CONFIG.target_entropy)), state)
        before = now.network, now.log_temperature
        return eqx.apply_updates(before, jax.tree.map(lambda d: -RATE * d, direction)), state

    state = adam.init((now.network, now.log_temperature))
    for seed in range(2):
        after, _ = update(now, batch, jax.random.key(seed), RATE, config=CONFIG)
        expected, state = stepped(now, state, jax.random.key(seed))
        for one, other in zip(*map(jax.tree.leaves, ((after.network, after.log_temperature), expected)), strict=True):
            np.testing.assert_allclose(one, other, atol=1e-6)
        now = after


SAC = SACConfig(**SMALL, learning_starts=CHUNK, critics_first=8)


@pytest.mark.slow
def test_a_game_keeps_its_noise_for_as_many_steps_as_the_config_says_and_each_side_has_its_own():
    """Actors that know nothing and say the same everywhere: what is left is the noise."""
    config = replace(SAC, noise_steps=16, learning_starts=10 * CHUNK)
    plan = Plan(config, SelfPlayConfig(env_steps=4 * CHUNK))
    state = start(plan, GAME, jax.random.key(0), {})
    state = eqx.tree_at(
        lambda this: [side.learner.network for side in this.learners.values()],
        state,
        replace_fn=lambda network: jax.tree.map(lambda leaf: 0 * leaf, network),
    )
    state, _ = play_and_learn(plan, GAME, state, {})
    chased, fled = (np.asarray(side.buffer.rows.action).reshape(8, 16, 64, 2) for side in state.learners.values())
    for levels in (chased, fled):
        assert (levels == levels[:, :1]).all()
        assert np.unique(levels[:, 0, :, 0]).size == 8 * 64
    assert (chased != fled).all()


def test_a_side_remembers_continuous_actions_and_learns_from_them():
    """Against a side that plays discrete ones; both play in one game."""
    plan, evader = Plan(SAC, StageConfig(env_steps=4 * CHUNK)), {Role.EVADER: solo(Uniform())}
    state = start(plan, GAME, jax.random.key(0), evader)
    before = jax.tree.map(np.array, state.learners[Role.PURSUER].learner.network)
    state, metrics = play_and_learn(plan, GAME, state, evader)
    actions = np.asarray(state.learners[Role.PURSUER].buffer.rows.action)
    assert actions.shape == (128, 64, 2)
    assert (np.abs(actions) <= 1).all()
    assert actions.std() > 0.1  # an actor that knows nothing has deviations of exp(-2)
    assert metrics.updates == 1
    assert metrics.outcomes.sum() > 0
    state, metrics = play_and_learn(plan, GAME, state, evader)
    assert metrics.updates == 128
    assert np.isfinite(metrics.losses.pursuer)
    assert not eqx.tree_equal(jax.tree.map(np.array, state.learners[Role.PURSUER].learner.network), before)
