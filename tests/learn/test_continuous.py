"""Training with continuous actions: the same run, stages, opponents and checkpoints as with discrete ones."""

from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
import pytest

from apollonius.agents.network import GaussianActor
from apollonius.agents.pool import solo
from apollonius.agents.squashed import SquashedMean
from apollonius.agents.store import load_agent
from apollonius.agents.uniform import Uniform
from apollonius.catalogue import find_player
from apollonius.evaluate.match import play_match
from apollonius.exploit.attack import best_response
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.learn.folder import create_run, load_config
from apollonius.learn.learner_config import SACConfig
from apollonius.learn.loop import play_and_learn
from apollonius.learn.run import Run
from apollonius.learn.stage_config import Plan, SelfPlayConfig, StageConfig
from apollonius.learn.train_state import start
from tests.learn.tiny import CHUNK, GAME, RUN, SMALL
from tests.matches import a_match

SAC = SACConfig(**SMALL, learning_starts=CHUNK, critics_first=8)
CONFIG = replace(RUN, sac=SAC, fixed_target=replace(RUN.fixed_target, env_steps=2 * CHUNK, evaluations=2))


def agents(folder):
    return {path.stem: path.read_bytes() for path in sorted((folder / "agents").iterdir())}


@pytest.mark.slow
def test_a_run_stopped_in_both_stages_and_resumed_ends_the_same(tmp_path):
    whole, halting = tmp_path / "whole", tmp_path / "halting"
    create_run(CONFIG, whole)
    assert Run(CONFIG, whole).execute()
    create_run(CONFIG, halting)
    for chunks in (1, 3):
        asked = iter(range(1, 100))
        assert not Run(CONFIG, halting, should_stop=lambda asked=asked, chunks=chunks: next(asked) == chunks).execute()
    assert load_config(halting / "config.toml") == CONFIG
    assert Run(load_config(halting / "config.toml"), halting).execute()
    assert agents(whole) == agents(halting)
    agent = load_agent(whole / "agents" / "E_curriculum.safetensors")
    assert isinstance(agent.network, GaussianActor)
    assert isinstance(find_player(str(whole / "agents" / "P_stage1.safetensors"), Role.PURSUER).policy, SquashedMean)


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


@pytest.mark.slow
def test_a_pursuer_learns_to_catch_a_standing_evader():
    """In an arena without discs, within 300,000 env steps, more often than random actions do by chance."""
    config = SACConfig(width=64, depth=2, games=64, env_steps_per_update=64, learning_starts=10_000, n_step=8)
    plan = Plan(config, StageConfig(env_steps=300_000))
    game = make_game("paper")
    game = replace(game, arena=replace(game.arena, discs=()), capture_distance=0.6)
    still = find_player("still", Role.EVADER).policy
    network = best_response(plan, game, still, Role.PURSUER, seed=0)
    learned, random = (
        play_match(a_match(game, policy, still, 200, seed=5)) for policy in (SquashedMean(network), Uniform())
    )
    assert random.outcomes["captured"] < 30
    assert learned.outcomes["captured"] > 100


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
