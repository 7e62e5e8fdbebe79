"""Opponents from the past: their slots, how they are drawn and judged, and that none changes within a game."""

from dataclasses import replace
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chisquare

from apollonius.agents.network import make_network
from apollonius.agents.pool import LearnerAndPast, single_player, stack
from apollonius.agents.trained import Greedy
from apollonius.game.types import Outcome, Role
from apollonius.learn import archive as archives
from apollonius.learn.loop import resample_all_opponents, train_chunk
from apollonius.learn.opponents import OpponentConfig
from apollonius.learn.stage_config import Plan, SelfPlayConfig
from tests.acting import act_in_rows, identical
from tests.learn.tiny import CHUNK, DQN, GAME, STAGE, start

SCHEMES = ("uniform", "prioritised-hard")
CONFIG = OpponentConfig(scheme="uniform", versions=4, slots=2, renewal=CHUNK)
GAMES = DQN.games
SLOT_GAMES = 8
"""Half of 64 games, shared by two slots of either side."""


enter = jax.jit(archives.add_version)


def networks(count):
    return [make_network("paper", width=8, depth=1, key=jax.random.key(number)) for number in range(count)]


def plan_of(config):
    """Versions enter every chunk and a half."""
    return Plan(DQN, SelfPlayConfig(env_steps=6 * CHUNK, opponents=config))


PLAN = plan_of(replace(CONFIG, renewal=1))
"""Slots are renewed after each chunk, though less is asked for."""


def archive_of(count, config=CONFIG):
    first, *later = networks(count)
    archive = archives.init_archive(first, config)
    for network in later:
        archive = enter(archive, network, jnp.asarray(True))
    return archive


def test_learner_and_past_versions_each_play_their_own_games():
    at_large, *others = networks(4)
    players = LearnerAndPast(
        Greedy(at_large), jax.tree.map(lambda *leaves: jnp.stack(leaves), *map(Greedy, others)), 3, 4, 5
    )
    bits = jnp.zeros(30, jnp.uint32)
    member = players.sample(bits)
    assert member.tolist() == [0] * 4 + [1] * 5 + [2] * 5 + [3] * 5 + [0] * 11
    observation = jax.random.normal(jax.random.key(9), (30, 8))
    acts = jax.jit(act_in_rows)
    expected = acts(stack([Greedy(one) for one in (at_large, *others)]), member, observation, bits)
    assert acts(players, member, observation, bits).tolist() == expected.tolist()
    alone = acts(single_player(Greedy(at_large)), member, observation, bits)
    assert (expected != alone).any()


def test_versions_enter_the_archive_when_due_until_it_is_full():
    archive = archive_of(3)
    assert int(archive.count) == 3
    assert identical(enter(archive, networks(4)[3], jnp.asarray(False)), archive)
    full = archive_of(4)
    assert identical(full.networks, jax.tree.map(lambda *leaves: np.stack(leaves), *networks(4)))
    assert identical(enter(full, networks(5)[4], jnp.asarray(True)), full)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_slots_follow_the_stated_distribution(scheme):
    config = replace(CONFIG, scheme=scheme, versions=5)
    archive = replace(
        archive_of(4, config),
        games=jnp.asarray([8.0, 8.0, 8.0, 0.0, 0.0]),
        lost=jnp.asarray([7.0, 3.0, 0.0, 0.0, 0.0]),
    )
    w = np.array([0.8, 0.4, 0.1, 0.5])
    weights = {"uniform": np.ones(4), "prioritised-hard": (1 - w) ** 2}[scheme]
    renewed = jax.jit(jax.vmap(lambda key: archives.resample_opponents(archive, config, key)))
    after = renewed(jax.random.split(jax.random.key(3), 5000))
    drawn = np.asarray(after.slots)
    assert identical(after.in_slots, jax.tree.map(lambda leaf: np.asarray(leaf)[drawn], archive.networks))
    assert identical(after.games, np.broadcast_to(archive.games / 2, (5000, 5)))
    assert identical(after.lost, np.broadcast_to(archive.lost / 2, (5000, 5)))
    seen = np.bincount(drawn.ravel(), minlength=5)
    assert seen[4] == 0, "a version that is not there yet"
    assert chisquare(seen[:4], drawn.size * weights / weights.sum()).pvalue > 0.001
    assert chisquare(seen[:4], drawn.size * weights[::-1] / weights.sum()).pvalue < 1e-6 or len(set(weights)) == 1


@pytest.mark.parametrize("role", Role)
def test_games_are_counted_for_the_version_that_played_them(role):
    rng = np.random.default_rng(0)
    outcome = rng.integers(1, len(Outcome), (7, GAMES))
    over = rng.random((7, GAMES)) < 0.2
    before = replace(archive_of(4), slots=jnp.asarray([2, 0]))
    archive = jax.jit(archives.record_results, static_argnums=(1, 2))(before, CONFIG, role, outcome, over)
    pursuer_won = np.isin(outcome, [Outcome.CAPTURED, Outcome.EVADER_HIT_OBSTACLE, Outcome.EVADER_OUT_OF_RANGE])
    lost = over & (~pursuer_won if role == Role.PURSUER else pursuer_won)
    first = 0 if role == Role.PURSUER else 2 * SLOT_GAMES
    for slot, version in enumerate([2, 0]):
        theirs = slice(first + slot * SLOT_GAMES, first + (slot + 1) * SLOT_GAMES)
        assert archive.games[version] == over[:, theirs].sum()
        assert archive.lost[version] == lost[:, theirs].sum()
    assert archive.games[jnp.asarray([1, 3])].tolist() == [0, 0]


def test_unbiased_endings_count_games_that_began_early_enough():
    """Of ten steps of a sitting games can last four: those count that begin at the seventh step at the latest."""
    ends = [[3, 6, 9], [2, 5, 6, 9], [0, 9], [9]]
    over = np.zeros((10, 4), bool)
    for game, steps in enumerate(ends):
        over[steps, game] = True
    counted = jax.jit(archives.unbiased_endings, static_argnums=3)
    for begins, first, steps, expected in (
        ([0, 0, 0, 0], 0, 10, [[3, 6], [2, 5, 6], [0, 9], [9]]),
        ([0, 0, 6, 7], 7, 10, [[], [], [2], [2]]),
        ([0, 1, 6, 7], 7, 11, [[2], [2], [2], [2]]),
    ):
        found = counted(over[first:], np.array(begins, np.int32), first, steps, 4)
        assert [np.flatnonzero(game).tolist() for game in found.T] == expected


@pytest.fixture(scope="module")
def played_states():
    """States, copied: start, after 1, 2, 3 chunks, opponents renewed, after 4."""
    state = start(PLAN, GAME, jax.random.key(0), {})
    states = [jax.tree.map(jnp.copy, state)]
    for chunk in range(4):
        if chunk == 3:
            state = resample_all_opponents(PLAN, GAME, state)
            states.append(jax.tree.map(jnp.copy, state))
        state, _ = train_chunk(PLAN, GAME, state, {})
        states.append(jax.tree.map(jnp.copy, state))
    return states


def test_renewal_restarts_games_in_slots_and_archives_the_average(played_states):
    before, after = played_states[3], played_states[4]
    in_slots = np.arange(GAMES) < 4 * SLOT_GAMES
    assert before.games.state.steps[in_slots].max() > 0
    assert after.games.state.steps[in_slots].tolist() == [0] * in_slots.sum()
    assert after.games.sides.pursuer.episode_return[in_slots].tolist() == [0] * in_slots.sum()
    assert identical(*(jax.tree.map(lambda leaf: leaf[~in_slots], state.games) for state in (before, after))), (
        "games at large go on"
    )
    for one, other in pairwise(played_states[:4]):
        assert identical(one.archives.pursuer.in_slots, other.archives.pursuer.in_slots)
    archive = after.archives.pursuer
    assert (int(before.archives.pursuer.count), int(archive.count)) == (1, 2)
    first, entered = (jax.tree.map(lambda leaf, number=number: leaf[number], archive.networks) for number in (0, 1))
    assert identical(entered, before.learners[Role.PURSUER].learner.average)
    assert not identical(entered, first)
    members = [state.games.sides.evader.member.tolist() for state in played_states]
    assert members == [[0] * 16 + [1] * 8 + [2] * 8 + [0] * 32] * len(played_states)


def test_interrupted_games_are_truncated_in_the_buffer(played_states):
    for role in Role:
        before, after = (state.learners[role].buffer for state in played_states[3:5])
        last = int(before.head) - 1
        terminated = before.rows.terminated[last]
        assert (after.rows.truncated[last] | terminated).tolist()[: 4 * SLOT_GAMES] == [True] * 4 * SLOT_GAMES
        assert identical(before.rows.terminated, after.rows.terminated)
        assert not (after.rows.truncated[last] & terminated).any()
        assert identical(before.rows.truncated.at[last].set(False), after.rows.truncated.at[last].set(False))


def test_archive_counts_games_in_slots_that_began_in_time(played_states):
    """Those of the first chunk, which the memory still holds: 128 steps, of which a game can last 100."""
    for role, first in ((Role.PURSUER, 0), (Role.EVADER, 2 * SLOT_GAMES)):
        rows = played_states[1].learners[role].buffer.rows
        over = np.asarray(rows.terminated | rows.truncated)[:, first : first + 2 * SLOT_GAMES]
        ends = [np.flatnonzero(game) for game in over.T]
        begins = [np.concatenate([[0], game[:-1] + 1]) for game in ends]
        counted = sum(int(np.sum(game <= CHUNK // GAMES - GAME.max_steps)) for game in begins)
        archive = played_states[1].archives[role]
        assert over.sum() > counted == archive.games[0] >= 2 * SLOT_GAMES
        assert 0 < archive.lost[0] < archive.games[0]


def test_opponents_are_renewed_no_sooner_than_configured():
    assert not Plan(DQN, STAGE).resamples_after(1)
    assert not plan_of(OpponentConfig()).resamples_after(1)
    for renewal, chunks in ((CHUNK, 1), (CHUNK + 1, 2), (2 * CHUNK, 2), (1, 1)):
        plan = plan_of(replace(CONFIG, renewal=renewal))
        assert plan.steps_per_assignment * GAMES == chunks * CHUNK >= renewal
        assert [plan.resamples_after(number) for number in range(5)] == [
            number > 0 and number % chunks == 0 for number in range(5)
        ]


def test_version_due_between_renewals_enters_at_the_next(played_states):
    state, counts = jax.tree.map(jnp.copy, played_states[0]), []
    for chunks in (1, 2, 3):
        state = resample_all_opponents(PLAN, GAME, replace(state, env_steps=jnp.int32(chunks * CHUNK)))
        counts.append(int(state.archives.pursuer.count))
    assert counts == [1, 2, 3]
