"""Opponents from the past: how they are drawn and judged, and that none changes within a game."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chisquare

from apollonius.agents.network import make_network
from apollonius.agents.trained import Greedy
from apollonius.cli.train import SCHEMES as OPTIONS
from apollonius.game.types import BySide, Outcome, Role
from apollonius.learn import earlier_versions
from apollonius.learn.earlier_versions import SCHEMES, EarlierVersions, draw_version, init_versions, learner_and_earlier
from apollonius.learn.self_play import draw_versions
from apollonius.play.rollout import Experience, Transition
from tests.acting import act_in_rows, identical
from tests.learn.tiny import CHUNK, DQN, GAME, SELF_PLAY, make_stage, start

CONFIG = replace(SELF_PLAY, env_steps=6 * CHUNK, opponents="uniform", versions=4, renewal=1)
"""Versions enter every chunk and a half; they are drawn after each chunk, though less is asked for."""
SHORT = replace(GAME, max_steps=100)
"""A chunk has 128 steps, so that every game ends between two draws."""

add_version = jax.jit(earlier_versions.add_version)


def networks(count):
    return [make_network("paper", width=8, depth=1, key=jax.random.key(number)) for number in range(count)]


def versions_of(count, room=4) -> EarlierVersions:
    first, *later = networks(count)
    earlier = init_versions(first, room)
    for network in later:
        earlier = add_version(earlier, network, jnp.asarray(True))
    return earlier


def version(earlier, number):
    return jax.tree.map(lambda leaf: leaf[number], earlier.networks)


def test_command_offers_the_schemes():
    assert tuple(SCHEMES) == OPTIONS


@pytest.mark.parametrize("turn", [0, 1])
def test_new_games_meet_the_learner_or_the_version_drawn_last(turn):
    learner, *_ = networks(5)
    earlier = replace(versions_of(4), drawn=jnp.array([3, 2]), turn=jnp.int32(turn))
    pool = learner_and_earlier(Greedy(learner), Greedy, earlier, 0.25)
    member = np.asarray(pool.sample(jax.random.bits(jax.random.key(0), (40_000,), jnp.uint32)))
    shares = np.bincount(member, minlength=3) / len(member)
    expected = [0.75, 0.25, 0.0] if turn == 0 else [0.75, 0.0, 0.25]
    np.testing.assert_allclose(shares, expected, atol=0.01)


def test_members_of_the_pool_act_by_their_own_networks():
    earlier = replace(versions_of(4), drawn=jnp.array([3, 1]))
    learner = networks(5)[4]
    pool = learner_and_earlier(Greedy(learner), Greedy, earlier, 0.5)
    observation = jax.random.normal(jax.random.key(9), (30, 8))
    acts = jax.jit(act_in_rows)
    bits = jnp.zeros(30, jnp.uint32)
    for member, network in enumerate((learner, version(earlier, 3), version(earlier, 1))):
        actions = acts(pool, jnp.full(30, member), observation, bits)
        assert actions.tolist() == np.argmax(network.batch(observation), axis=1).tolist()


def test_versions_enter_when_due_until_there_is_no_room():
    earlier = versions_of(3)
    assert int(earlier.count) == 3
    assert identical(add_version(earlier, networks(4)[3], jnp.asarray(False)), earlier)
    full = versions_of(4)
    assert identical(full.networks, jax.tree.map(lambda *leaves: np.stack(leaves), *networks(4)))
    assert identical(add_version(full, networks(5)[4], jnp.asarray(True)), full)


@pytest.mark.parametrize("scheme", ["uniform", "prioritised-hard"])
def test_draws_follow_the_stated_distribution(scheme):
    earlier = replace(
        versions_of(4, room=5),
        games=jnp.asarray([8.0, 8.0, 8.0, 0.0, 0.0]),
        lost=jnp.asarray([7.0, 3.0, 0.0, 0.0, 0.0]),
        turn=jnp.int32(3),
        drawn=jnp.array([1, 3]),
    )
    w = np.array([0.8, 0.4, 0.1, 0.5])
    weights = {"uniform": np.ones(4), "prioritised-hard": (1 - w) ** 2}[scheme]
    draws = jax.jit(jax.vmap(lambda key: draw_version(earlier, scheme, key)))
    after = draws(jax.random.split(jax.random.key(3), 10_000))
    assert set(np.asarray(after.turn)) == {4}
    assert set(np.asarray(after.drawn[:, 1])) == {3}, "the version before goes on playing"
    assert identical(after.games, np.broadcast_to(earlier.games / 2, (10_000, 5)))
    assert identical(after.lost, np.broadcast_to(earlier.lost / 2, (10_000, 5)))
    counts = np.bincount(np.asarray(after.drawn[:, 0]), minlength=5)
    assert counts[4] == 0, "a version that is not there yet"
    assert chisquare(counts[:4], 10_000 * weights / weights.sum()).pvalue > 0.001
    assert chisquare(counts[:4], 10_000 * weights[::-1] / weights.sum()).pvalue < 1e-6 or len(set(weights)) == 1


@pytest.mark.parametrize("role", Role)
def test_games_are_counted_for_the_version_that_played_them(role):
    rng = np.random.default_rng(0)
    shape = (7, 64)
    outcome, ended = rng.integers(1, len(Outcome), shape), rng.random(shape) < 0.2
    member, other = rng.integers(0, 3, shape), rng.integers(0, 2, shape)
    nothing = jnp.zeros(shape)

    def side(members):
        actions = nothing.astype(jnp.int32)
        numbers, flags = nothing[..., None], jnp.zeros(shape, bool)
        return Experience(numbers, actions, nothing, numbers, nothing, jnp.asarray(members), ~flags, flags)

    played = Transition(
        BySide.of(role, side(member), side(other)), jnp.asarray(outcome), jnp.asarray(ended), jnp.zeros(shape, bool)
    )
    before = replace(versions_of(4), drawn=jnp.asarray([2, 0]))
    after = jax.jit(earlier_versions.record_results, static_argnums=1)(before, role, played)
    pursuer_won = np.isin(outcome, [Outcome.CAPTURED, Outcome.EVADER_HIT_OBSTACLE, Outcome.EVADER_OUT_OF_RANGE])
    lost = ~pursuer_won if role == Role.PURSUER else pursuer_won
    for slot, number in enumerate([2, 0]):
        own = ended & (member == slot + 1) & (other == 0)
        assert after.games[number] == own.sum() > 0
        assert after.lost[number] == (own & lost).sum() > 0
    assert after.games[jnp.asarray([1, 3])].tolist() == [0, 0]


@pytest.fixture(scope="module")
def stage():
    return make_stage(CONFIG, game=SHORT)


@pytest.fixture(scope="module")
def played_states(stage):
    """States, copied: start, and after 1, 2, 3 chunks, before each of which but the first versions are drawn."""
    state = start(stage, jax.random.key(0))
    states = [jax.tree.map(jnp.copy, state)]
    for _ in range(3):
        state, _ = stage.step(state)
        states.append(jax.tree.map(jnp.copy, state))
    return states


def test_draw_leaves_games_alone_and_adds_the_average(played_states, stage):
    before = played_states[2]
    after = draw_versions(stage, jax.tree.map(jnp.copy, before))
    assert identical(after.games, before.games)
    assert identical(after.learners, before.learners)
    old, new = before.earlier.pursuer, after.earlier.pursuer
    assert (int(old.count), int(new.count)) == (1, 2)
    assert identical(version(new, int(new.count) - 1), before.learners[Role.PURSUER].learner.average)


def test_draws_alternate_between_two_places(played_states):
    for role in Role:
        members = [np.asarray(state.games.sides[role].member) for state in played_states]
        assert [set(each) for each in members] == [{0, 1}, {0, 1}, {0, 2}, {0, 1}]
        assert [int(state.earlier[role].turn) for state in played_states] == [0, 0, 1, 2]


def test_no_game_is_left_with_the_version_that_is_replaced(played_states):
    """A draw takes the place of the version before the last: its games ended in the chunk before."""
    for state in played_states[1:]:
        for role in Role:
            next_slot = (int(state.earlier[role].turn) + 1) % 2
            assert next_slot + 1 not in np.asarray(state.games.sides[role].member)


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_share_of_games_has_an_earlier_version_on_a_side(played_states, share):
    players = make_stage(replace(CONFIG, past_share=share), game=SHORT).players(played_states[1])
    bits = jax.random.bits(jax.random.key(0), (2, 40_000), jnp.uint32)
    pursuer, evader = (np.asarray(players[role].sample(bits[role])) > 0 for role in Role)
    assert np.mean(pursuer | evader) == pytest.approx(share, abs=0.01)
    assert np.mean(pursuer) == pytest.approx(np.mean(evader), abs=0.01)


def test_results_of_versions_are_those_of_the_games(played_states):
    for role in Role:
        earlier = played_states[1].earlier[role]
        assert 0 < earlier.lost[0] < earlier.games[0]
        assert earlier.games[1:].tolist() == [0, 0, 0]
        rows = played_states[1].learners[role].buffer.rows
        over = int(np.sum(np.asarray(rows.terminated | rows.truncated)))
        assert 0.1 * over < earlier.games[0] < 0.4 * over, (
            "some three in ten games meet a version, most of them a learner"
        )


@pytest.mark.parametrize(("renewal", "chunks"), [(CHUNK, 1), (CHUNK + 1, 2), (2 * CHUNK, 2), (1, 1)])
def test_versions_are_drawn_no_sooner_than_configured(renewal, chunks):
    assert replace(CONFIG, renewal=renewal).chunks_per_draw(DQN) == chunks


def test_version_due_between_draws_enters_at_the_next(played_states, stage):
    state, counts = jax.tree.map(jnp.copy, played_states[0]), []
    for chunks in (1, 2, 3):
        state = draw_versions(stage, replace(state, env_steps=jnp.int32(chunks * CHUNK)))
        counts.append(int(state.earlier.pursuer.count))
    assert counts == [1, 2, 3]


def test_latest_has_no_earlier_versions():
    assert make_stage(SELF_PLAY).init(jax.random.key(0)).earlier is None
