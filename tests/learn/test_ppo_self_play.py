"""Proximal policy optimisation in the paper's two stages, alone and with a magnet."""

from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
import pytest

from apollonius.arenas.file import to_dict
from apollonius.game.types import Role
from apollonius.learn.config import read_config
from apollonius.learn.folder import create_run
from apollonius.learn.ppo import PPOConfig
from apollonius.learn.run import TrainingRun
from tests.learn.test_run import agents, stop_after
from tests.learn.tiny import GAME, RUN, SELF_PLAY, STAGE, make_stage, start

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
