"""Training with continuous actions: the same run, stages, opponents and checkpoints as with discrete ones."""

from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
import pytest

from apollonius.agents.classical import Uniform
from apollonius.agents.pool import solo
from apollonius.game.types import Role
from apollonius.learn.learner_config import SACConfig
from apollonius.learn.loop import play_and_learn
from apollonius.learn.stage_config import Plan, SelfPlayConfig, StageConfig
from apollonius.learn.train_state import start
from tests.learn.tiny import CHUNK, GAME, SMALL

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
