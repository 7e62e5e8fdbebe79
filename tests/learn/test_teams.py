"""Teams learn: every robot's part is remembered, a robot's game is over when it is out, and then it does not count."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.classical import Still
from apollonius.agents.network import make_network
from apollonius.agents.pool import solo
from apollonius.agents.store import describe, save_agent
from apollonius.game.presets import in_teams
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput
from apollonius.learn import dqn, replay_buffer
from apollonius.learn.loop import play_and_learn, renew_opponents
from apollonius.learn.opponents import OpponentConfig
from apollonius.learn.run import load_first
from apollonius.learn.stage_config import Plan, SelfPlayConfig
from apollonius.learn.train_state import start
from tests.learn.tiny import CHUNK, DQN, GAME, PLAN, RUN, STAGE

PURSUERS = 2
TEAM = in_teams(GAME, PURSUERS, 1)
EVADER = {Role.EVADER: solo(Still())}


@pytest.fixture(scope="module")
def memory():
    """What two pursuers remember of a chunk, columns `[games, robots]`, and the chunk's metrics."""
    plan = replace(PLAN, learner=replace(DQN, learning_starts=CHUNK // 2))
    first = start(plan, TEAM, jax.random.key(0), EVADER)
    before = jax.tree.map(np.array, first.learners[Role.PURSUER].learner.network)
    state, metrics = play_and_learn(plan, TEAM, first, EVADER)
    learner = state.learners[Role.PURSUER]
    assert not jax.tree.all(jax.tree.map(np.array_equal, before, learner.learner.network))
    rows = jax.tree.map(
        lambda leaf: np.asarray(leaf).reshape(-1, DQN.games, PURSUERS, *leaf.shape[2:]), learner.buffer.rows
    )
    return rows, jax.tree.map(np.asarray, metrics)


def test_every_robot_of_a_team_is_remembered(memory):
    rows, _ = memory
    assert rows.reward.shape == (CHUNK // DQN.games, DQN.games, PURSUERS)
    one, other = np.moveaxis(rows.observation, 2, 0)
    assert (one != other).any(axis=-1).mean() > 0.9
    np.testing.assert_array_equal(one[:20, :, 4:7], other[:20, :, 4:7], err_msg="both see the same evader")
    assert 0.05 < np.mean(rows.action[..., 0] == rows.action[..., 1]) < 0.95


def test_a_robots_game_is_over_when_it_is_out_and_the_game_goes_on(memory):
    """Then it is not active until the next game begins, which is when its mate's is over too."""
    rows, metrics = memory
    over = rows.terminated | rows.truncated
    together = over.all(axis=2)
    alone = over & ~together[..., None] & rows.active.all(axis=2, keepdims=True)
    assert alone.sum() > 20, "one robot fails and the other plays on"
    assert (rows.reward[alone] == -GAME.reward.failure).all()
    for steps, game, robot in np.argwhere(alone[:-1]):
        rest = rows.active[steps + 1 :, game]
        assert not rest[0, robot]
        ends = np.flatnonzero(over[steps + 1 :, game, 1 - robot] & rest[:, 1 - robot])
        if len(ends):
            assert not rest[: ends[0] + 1, robot].any()
            assert rest[ends[0] + 1 :][:1].all()
    assert not (rows.terminated & rows.truncated).any()
    ended = (rows.terminated | rows.truncated | ~rows.active).all(axis=2).sum()
    assert ended == metrics.outcomes.sum()


def test_the_loss_does_not_see_robots_that_are_out():
    network = make_network("paper", 16, 1, jax.random.key(0))
    numbers = jax.random.normal(jax.random.key(1), (4, 8))
    batch = replay_buffer.Batch(numbers, jnp.arange(4), jnp.ones(4), numbers, jnp.full(4, 0.5))
    half = replace(batch, active=jnp.array([True, True, False, False]))
    first = jax.tree.map(lambda leaf: leaf[:2], batch)
    graded = jax.jit(jax.value_and_grad(dqn.loss), static_argnums=3)
    (value, slope), (alone, its_slope) = (graded(network, network, one, True) for one in (half, first))
    assert value == pytest.approx(float(alone) / 2, rel=1e-5)
    for one, other in zip(jax.tree.leaves(slope), jax.tree.leaves(its_slope), strict=True):
        np.testing.assert_allclose(one, other / 2, atol=1e-6)


@pytest.mark.slow
def test_both_sides_learn_in_teams_against_earlier_versions():
    """Two against two: every robot of a team is in its game's slot, and broken-off games are cut for all."""
    opponents = OpponentConfig(scheme="uniform", versions=4, slots=2, renewal=CHUNK)
    plan = Plan(DQN, SelfPlayConfig(**vars(STAGE) | {"opponents": opponents}))
    game = in_teams(GAME, 2, 2)
    state = start(plan, game, jax.random.key(0), {})
    for chunk in range(4):
        if chunk == 3:
            state = renew_opponents(plan, game, state)
            rows = state.learners[Role.EVADER].buffer.rows
            latest = int(state.learners[Role.EVADER].buffer.head) - 1
            over = np.asarray(rows.terminated | rows.truncated | ~rows.active)[latest].reshape(-1, 2)
            assert over[:32].all()
            assert not over[32:].all()
        state, metrics = play_and_learn(plan, game, state, {})
    assert metrics.updates == 128
    assert np.isfinite(metrics.losses.pursuer)
    assert np.isfinite(metrics.losses.evader)
    assert metrics.outcomes.sum() > 20


def test_an_agent_that_reads_egocentric_goes_on_in_teams(tmp_path):
    path = tmp_path / "P.safetensors"
    network = make_network("egocentric", 16, 1, jax.random.key(0))
    save_agent(describe(network, Role.PURSUER, {}, {}), path)
    config = replace(RUN, stages="fixed-target", game=TEAM, pursuer=str(path), dqn=replace(DQN, observation="team"))
    wide = load_first(config, Role.PURSUER)
    weight = np.asarray(wide.layers[0].weight)
    np.testing.assert_array_equal(weight[:, : network.observation.size], network.layers[0].weight)
    assert not weight[:, network.observation.size :].any()
    with pytest.raises(InvalidInput, match="'paper'"):
        load_first(replace(config, dqn=replace(DQN, observation="paper")), Role.PURSUER)
