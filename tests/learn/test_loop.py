"""A stage of training: seeds, counters, schedules, and when learning happens.

Most tests read one short stage, played once: exploring in its first chunk, greedy from the second on, learning from
env step 20,000 (in the third chunk) on.
"""

from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.classical import Still
from apollonius.agents.pool import solo
from apollonius.arenas.file import find_game
from apollonius.game.game import Game
from apollonius.game.types import Outcome, Role
from apollonius.learn.loop import Metrics, play_and_learn
from apollonius.learn.train_state import TrainState, start
from tests.acting import identical
from tests.learn.tiny import CHUNK, GAME, PLAN

EVADER = {Role.EVADER: solo(Still())}


@dataclass(frozen=True)
class Snapshot:
    """A copy of the state after some chunks, and the metrics of the latest one."""

    state: TrainState
    metrics: Metrics | None

    @property
    def learner(self):
        return self.state.learners[Role.PURSUER].learner

    @property
    def seen(self):
        return self.state.learners[Role.PURSUER].buffer.rows


def copy(tree):
    """A copy in NumPy, which outlives the donation of the original; keys become their numbers."""
    is_key = lambda leaf: jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key)  # noqa: E731
    return jax.tree.map(lambda leaf: np.array(jax.random.key_data(leaf) if is_key(leaf) else leaf), tree)


def play_stage(seed, chunks, game=GAME, plan=PLAN):
    state = start(plan, game, jax.random.key(seed), EVADER)
    moments = [Snapshot(copy(state), None)]
    for _ in range(chunks):
        state, metrics = play_and_learn(plan, game, state, EVADER)
        moments.append(Snapshot(copy(state), copy(metrics)))
    return moments


@pytest.fixture(scope="module")
def stage():
    return play_stage(seed=0, chunks=4)


def share_equal(one, other):
    return np.mean(one == other)


def test_updates_wait_for_a_whole_window_and_only_those_made_are_counted():
    """A chunk that begins late in a stage, but with an empty replay."""
    begun = start(PLAN, GAME, jax.random.key(0), EVADER)
    begun = eqx.tree_at(lambda state: state.env_steps, begun, jnp.asarray(20_000, jnp.int32))
    state, metrics = play_and_learn(PLAN, GAME, begun, EVADER)
    assert 128 - 3 <= state.learners[Role.PURSUER].learner.updates < 128
    assert metrics.updates == state.learners[Role.PURSUER].learner.updates


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


def test_the_target_is_copied_at_its_period_and_kept_in_between(stage):
    """The period is three chunks."""
    start, _, before, due, after = stage
    assert identical(before.learner.target, start.learner.network)
    assert identical(due.learner.target, due.learner.network)
    assert identical(after.learner.target, due.learner.network)
    assert not identical(after.learner.target, after.learner.network)


def greedy_share(moment, network, rows):
    """How often the actions in some rows of the replay are the best ones of a network."""
    values = jax.vmap(jax.vmap(network))(moment.seen.observation[rows])
    return share_equal(np.argmax(values, axis=-1), moment.seen.action[rows])


def test_play_explores_as_scheduled_and_then_is_greedy(stage):
    """Nothing is learned in the first two chunks, so the network that acted in them is known."""
    _, exploring, greedy, _, _ = stage
    network = jax.tree.map(jnp.asarray, greedy.learner.network)
    assert greedy_share(exploring, network, slice(0, 10)) == pytest.approx(1 / 9 + 0.035, abs=0.07)
    assert greedy_share(exploring, network, slice(59, 69)) == pytest.approx(0.5 + 0.5 / 9, abs=0.07)
    assert greedy_share(greedy, network, slice(0, 128)) == 1.0


class CountingGame(Game):
    """A game that counts how often its rules are traced."""

    def step_controls(self, state, controls):
        traces.append("step")
        return super().step_controls(state, controls)


traces = []


def test_a_stage_is_traced_once():
    """Not again for later chunks, nor for other numbers of the game or another seed, with sensors too."""
    game = replace(CountingGame(**vars(GAME)), sensors=find_game("lidar").sensors)
    before = len(traces)
    play_stage(seed=0, chunks=1, game=game)
    first = len(traces)
    assert first > before
    play_stage(seed=1, chunks=2, game=replace(game, capture_distance=0.4, max_steps=90))
    assert len(traces) == first


def test_the_state_is_donated():
    """So that the replay is updated in place."""
    before = start(PLAN, GAME, jax.random.key(0), EVADER)
    address = before.learners[Role.PURSUER].buffer.rows.observation.unsafe_buffer_pointer()
    after, _ = play_and_learn(PLAN, GAME, before, EVADER)
    assert before.learners[Role.PURSUER].buffer.rows.observation.is_deleted()
    assert after.learners[Role.PURSUER].buffer.rows.observation.unsafe_buffer_pointer() == address
