"""A stage of training: seeds, counters, schedules, when learning happens, and that every robot of a team learns.

Most tests read one short stage, played once: exploring in its first chunk, greedy from the second on, learning from
env step 20,000 (in the third chunk) on.
"""

from dataclasses import replace
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.network import make_network
from apollonius.agents.store import describe, save_agent
from apollonius.arenas.file import find_game
from apollonius.game.game import Game
from apollonius.game.presets import in_teams
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.learn import dqn, replay_buffer
from apollonius.learn.rollout_stage import train_chunk
from apollonius.learn.run import load_first_network
from tests.acting import identical
from tests.learn.tiny import CHUNK, DQN, GAME, RUN, SELF_PLAY, STAGE, make_stage, start


def copy(tree):
    """A copy in NumPy, which outlives the donation of the original; keys become their numbers."""
    is_key = lambda leaf: jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key)  # noqa: E731
    return jax.tree.map(lambda leaf: np.array(jax.random.key_data(leaf) if is_key(leaf) else leaf), tree)


def snapshot(state, metrics=None):
    """A copy of the state after some chunks, and the metrics of the latest one."""
    state, metrics = copy((state, metrics))
    side = state.learners[Role.PURSUER]
    return SimpleNamespace(state=state, metrics=metrics, learner=side.learner, seen=side.buffer.rows)


@pytest.fixture(scope="module")
def stage():
    trained = make_stage()
    state = start(trained, jax.random.key(0))
    moments = [snapshot(state)]
    for _ in range(4):
        state, metrics = trained.step(state)
        moments.append(snapshot(state, metrics))
    return moments


def test_updates_wait_for_a_full_window_and_the_buffer_is_donated():
    """In a chunk that begins late in a stage, but with an empty replay."""
    stage_1 = make_stage()
    begun = start(stage_1, jax.random.key(0))
    begun = eqx.tree_at(lambda state: state.env_steps, begun, jnp.asarray(20_000, jnp.int32))
    before = begun.learners[Role.PURSUER].buffer.rows.observation
    address = before.unsafe_buffer_pointer()
    state, metrics = stage_1.step(begun)
    after = state.learners[Role.PURSUER]
    assert 128 - 3 <= after.learner.updates < 128
    assert metrics.updates == after.learner.updates
    assert before.is_deleted()
    assert after.buffer.rows.observation.unsafe_buffer_pointer() == address


def test_env_steps_episodes_and_updates_are_counted_exactly(stage):
    episodes = 0
    for chunk, moment in enumerate(stage[1:], start=1):
        over = moment.seen.terminated | moment.seen.truncated
        episodes += over.sum()
        assert over.sum() > 0
        assert moment.metrics.outcomes.sum() == over.sum()
        assert moment.metrics.outcomes[Outcome.NO_RESULT] == moment.seen.truncated.sum()
        assert moment.state.env_steps == chunk * CHUNK
        assert moment.state.iterations == chunk * 128
        assert moment.state.episodes == episodes
    # The first update comes with the iteration that reaches 20,000 env steps: the 313th, the 57th of chunk 3.
    assert [int(moment.metrics.updates) for moment in stage[1:]] == [0, 0, 128 - 56, 128]
    assert [int(moment.learner.updates) for moment in stage] == [0, 0, 0, 72, 200]


def test_returns_are_summed_over_finished_games(stage):
    """One chunk holds every game of length 100 at most that ends in it, but for the 64 that began before it."""
    seen, metrics = stage[1].seen, stage[1].metrics
    expected, running = 0.0, np.zeros(64)
    for reward, over in zip(seen.reward, seen.terminated | seen.truncated, strict=True):
        running += reward
        expected += running[over].sum()
        running[over] = 0
    assert metrics.returns.pursuer == pytest.approx(expected, rel=1e-4)


def test_nothing_is_learned_before_learning_starts(stage):
    start, _, greedy, learning, _ = stage
    assert identical(start.learner, greedy.learner)
    assert greedy.metrics.losses.pursuer == 0
    assert not identical(greedy.learner.network, learning.learner.network)
    assert not identical(greedy.learner.average, learning.learner.average)
    assert learning.metrics.losses.pursuer > 0
    assert learning.metrics.losses.evader == 0


def test_target_network_is_copied_once_per_period(stage):
    """The period is three chunks."""
    start, _, before, due, after = stage
    assert identical(before.learner.target, start.learner.network)
    assert identical(due.learner.target, due.learner.network)
    assert identical(after.learner.target, due.learner.network)
    assert not identical(after.learner.target, after.learner.network)


def test_play_explores_as_scheduled_and_then_is_greedy(stage):
    """Nothing is learned in the first two chunks, so the network that acted in them is known."""
    _, exploring, greedy, _, _ = stage
    values = jax.jit(jax.vmap(jax.vmap(jax.tree.map(jnp.asarray, greedy.learner.network))))
    exploits, all_exploit = (
        np.argmax(values(moment.seen.observation), axis=-1) == moment.seen.action for moment in (exploring, greedy)
    )
    assert np.mean(exploits[:10]) == pytest.approx(1 / 9 + 0.035, abs=0.07)
    assert np.mean(exploits[59:69]) == pytest.approx(0.5 + 0.5 / 9, abs=0.07)
    assert all_exploit.all()


@pytest.mark.parametrize("terminates", [False, True])
def test_training_games_end_at_the_time_limit_of_their_stage(terminates):
    short = make_stage(replace(STAGE, time_limit=5, limit_terminates=terminates))
    state, _ = short.step(start(short, jax.random.key(0)))
    rows = state.learners[Role.PURSUER].buffer.rows
    assert int(jnp.max(state.games.state.steps)) < 5
    assert bool(jnp.any(rows.truncated)) is not terminates
    assert bool(jnp.any(rows.terminated)) is terminates


def test_stage_is_traced_once(monkeypatch):
    """Not again for later chunks, nor for other numbers of the game or another seed, with sensors too."""
    traces, step_controls = [], Game.step_controls
    monkeypatch.setattr(Game, "step_controls", lambda *given: traces.append("step") or step_controls(*given))
    seeing = replace(GAME, sensors=find_game("lidar").sensors)
    for seed, game in enumerate((seeing, replace(seeing, capture_distance=0.4, max_steps=90))):
        stage_1 = make_stage(game=game)
        state = start(stage_1, jax.random.key(seed))
        for chunk in range(2):
            before = len(traces)
            state, _ = train_chunk.eval_shape(stage_1, state)
            assert (len(traces) > before) == (seed == chunk == 0)


PURSUERS = 2
TEAM = in_teams(GAME, PURSUERS, 1)


def test_buffer_stores_each_robot_of_a_team_until_it_is_out():
    """Of two pursuers, rows `[steps, games, robots]`. One that is out is not active until the next game begins, which
    is when its mate's is over too.
    """
    stage_1 = make_stage(algorithm=replace(DQN, learning_starts=CHUNK // 2), game=TEAM)
    first = start(stage_1, jax.random.key(0))
    before = copy(first.learners[Role.PURSUER].learner.network)
    state, metrics = stage_1.step(first)
    side = copy(state.learners[Role.PURSUER])
    assert not identical(before, side.learner.network)
    rows = jax.tree.map(lambda leaf: leaf.reshape(-1, DQN.games, PURSUERS, *leaf.shape[2:]), side.buffer.rows)
    assert rows.reward.shape == (CHUNK // DQN.games, DQN.games, PURSUERS)
    one, other = np.moveaxis(rows.observation, 2, 0)
    assert (one != other).any(axis=-1).mean() > 0.9
    np.testing.assert_array_equal(one[:20, :, 4:7], other[:20, :, 4:7], err_msg="both see the same evader")
    assert 0.05 < np.mean(rows.action[..., 0] == rows.action[..., 1]) < 0.95

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


def test_dqn_loss_ignores_inactive_robots():
    network = make_network("paper", 16, 1, jax.random.key(0))
    numbers = jax.random.normal(jax.random.key(1), (4, 8))
    active = jnp.array([True, True, False, False])
    half = replay_buffer.TransitionBatch(numbers, jnp.arange(4), jnp.ones(4), numbers, jnp.full(4, 0.5), active)
    first = jax.tree.map(lambda leaf: leaf[:2], half)
    graded = jax.jit(jax.value_and_grad(dqn.loss), static_argnums=3)
    (value, slope), (alone, its_slope) = (graded(network, network, one, True) for one in (half, first))
    assert value == pytest.approx(float(alone) / 2, rel=1e-5)
    for one, other in zip(jax.tree.leaves(slope), jax.tree.leaves(its_slope), strict=True):
        np.testing.assert_allclose(one, other / 2, atol=1e-6)


@pytest.mark.slow
def test_both_teams_learn_against_earlier_versions():
    """Two against two: team mates are the same version."""
    config = replace(SELF_PLAY, opponents="uniform", versions=4, renewal=CHUNK)
    stage_2 = make_stage(config, game=in_teams(GAME, 2, 2))
    state = start(stage_2, jax.random.key(0))
    for _ in range(4):
        state, metrics = stage_2.step(state)
    assert [int(earlier.turn) for earlier in state.earlier] == [3, 3]
    assert [int(earlier.count) for earlier in state.earlier] == [4, 4]
    assert metrics.updates == 128
    assert np.isfinite(metrics.losses.pursuer)
    assert np.isfinite(metrics.losses.evader)
    assert metrics.outcomes.sum() > 20


def test_egocentric_agent_initializes_a_team_network(tmp_path):
    path = tmp_path / "P.safetensors"
    network = make_network("egocentric", 16, 1, jax.random.key(0))
    save_agent(describe(network, Role.PURSUER, {}, {}), path)
    team = replace(DQN, observation="team")
    config = replace(RUN, stages=(STAGE,), game=TEAM, pursuer=str(path), algorithm=team)
    wide = load_first_network(config, Role.PURSUER)
    weight = np.asarray(wide.layers[0].weight)
    np.testing.assert_array_equal(weight[:, : network.observation.size], network.layers[0].weight)
    assert not weight[:, network.observation.size :].any()
    assert not wide.symmetric
    assert load_first_network(replace(config, algorithm=replace(team, symmetric=True)), Role.PURSUER).symmetric
    save_agent(describe(replace(network, symmetric=True), Role.PURSUER, {}, {}), path)
    assert load_first_network(config, Role.PURSUER).symmetric
    with pytest.raises(InvalidInput, match="'paper'"):
        load_first_network(replace(config, algorithm=replace(DQN, observation="paper")), Role.PURSUER)
