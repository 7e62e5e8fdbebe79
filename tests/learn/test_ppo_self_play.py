"""Proximal policy optimisation in the paper's two stages, alone and with a magnet."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.network import make_network
from apollonius.agents.store import describe, save_agent
from apollonius.arenas.file import to_dict
from apollonius.game.game import reset_batch
from apollonius.game.types import Role
from apollonius.learn.config import read_config
from apollonius.learn.folder import create_run
from apollonius.learn.ppo import PPOConfig
from apollonius.learn.run import TrainingRun, load_first_network
from tests.learn.test_run import agents, stop_after
from tests.learn.tiny import DQN, GAME, RUN, SELF_PLAY, STAGE, make_stage, start

PPO = PPOConfig(
    observation="paper",
    width=16,
    depth=1,
    games=64,
    steps=128,
    batch=1024,
    learning_rate=1e-2,
    critic_first=1,
    magnet=0.1,
    magnet_rounds=2,
)
"""A round is a chunk of the other tests. It has 16 updates."""


def test_both_sides_learn_and_are_drawn_to_their_magnets():
    stage = make_stage(SELF_PLAY, PPO)
    first = start(stage, jax.random.key(0))
    networks = {role: jax.tree.map(np.asarray, first.learners[role].learner.network) for role in Role}
    state, metrics = stage.step(first)
    assert int(metrics.updates) == 16
    assert int(state.env_steps) == 64 * 128
    assert metrics.outcomes.sum() > 20
    for role in Role:
        assert eqx.tree_equal(state.learners[role].learner.network, networks[role]), "the critic learns first"
    state, _ = stage.step(state)
    for role in Role:
        learner = state.learners[role].learner
        assert not eqx.tree_equal(learner.network, networks[role])
        assert eqx.tree_equal(learner.magnet, learner.network), "after two rounds"
    state, _ = stage.step(state)
    for role in Role:
        learner = state.learners[role].learner
        assert not eqx.tree_equal(learner.magnet, learner.network)


def test_rewards_reach_the_critic_in_units_of_a_capture():
    """Where captures alone are paid, it does not matter how much."""
    config = replace(SELF_PLAY, progress=0.0, failure=0.0)

    def learned(capture):
        game = replace(GAME, reward=replace(GAME.reward, capture=capture))
        stage = make_stage(config, PPO, game)
        state, _ = stage.step(start(stage, jax.random.key(0)))
        return state.learners[Role.EVADER].learner.critic

    one, ten = learned(1.0), learned(10.0)
    for mine, other in zip(jax.tree.leaves(one), jax.tree.leaves(ten), strict=True):
        np.testing.assert_allclose(mine, other, atol=1e-6)


def test_sides_learn_nothing_from_what_earlier_versions_played():
    past = replace(SELF_PLAY, opponents="uniform", versions=4, renewal=64 * 128, past_share=0.75)
    stage = make_stage(past, replace(PPO, critic_first=0))
    state = start(stage, jax.random.key(0))
    drawn = reset_batch(stage.game, jax.random.key(1), 4 * 64)
    starts = jax.tree.map(lambda leaf: leaf.reshape(4, 64, *leaf.shape[1:]), drawn)
    _, played = jax.jit(type(stage).play)(stage, state, starts, jax.random.key(2))
    side = played.sides.evader
    is_own = np.asarray(side.member) == 0
    assert 0.3 < is_own.mean() < 0.7

    @jax.jit
    def learned(reward):
        changed = replace(played, sides=replace(played.sides, evader=replace(side, reward=reward)))
        return stage.learn(state, Role.EVADER, changed, jnp.int32(64 * 128), jax.random.key(3))[0].learner

    reward = np.asarray(side.reward)
    as_played = learned(reward)
    assert eqx.tree_equal(learned(np.where(is_own, reward, 99.0)), as_played)
    assert not eqx.tree_equal(learned(np.where(is_own, 99.0, reward)), as_played)


@pytest.mark.parametrize(
    ("algorithm", "stage", "value"),
    [
        (PPO, SELF_PLAY, 1 / PPO.temperature),
        (DQN, replace(STAGE, failure=7.0), 7.0),
        (DQN, replace(STAGE, failure=0.0), None),
    ],
)
def test_a_training_goes_on_in_its_own_units(algorithm, stage, value, tmp_path):
    """Whatever the units of the first agent, of which a lost game is worth 500."""
    assert make_stage(stage, algorithm).loss_value == value
    network = make_network("paper", 16, 1, jax.random.key(0))
    file = tmp_path / "P.safetensors"
    save_agent(describe(network, Role.PURSUER, {}, {}, loss_value=500.0), file)
    config = replace(RUN, algorithm=algorithm, stages=(stage,), pursuer=str(file))
    scale = (value or 500.0) / 500.0
    seen = jax.random.normal(jax.random.key(1), (5, 8))
    first = load_first_network(config, Role.PURSUER)
    np.testing.assert_allclose(first.batch(seen), scale * network.batch(seen), rtol=1e-5)


@pytest.mark.slow
def test_killed_run_with_earlier_versions_ends_the_same(tmp_path):
    past = replace(SELF_PLAY, opponents="uniform", versions=4, renewal=64 * 128)
    config = replace(RUN, algorithm=PPO, stages=(STAGE, past))
    assert read_config(to_dict(config), "a test") == config
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    for folder in (whole, broken):
        create_run(config, folder)
    assert TrainingRun(config, whole).execute()
    for chunks in (2, 4):
        assert not TrainingRun(config, broken, should_stop=stop_after(chunks)).execute()
    assert TrainingRun(config, broken).execute()
    assert agents(broken) == agents(whole)
