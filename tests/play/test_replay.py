"""A game step by step, and its file: it plays again to the same bits, as golden games do, or what differs is named."""

from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from apollonius.agents.greedy import SquashedGaussian
from apollonius.agents.kind import Named
from apollonius.agents.network import make_actor
from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, play_games, record_game
from apollonius.game.by_side import BySide
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.play.random_bits import fold_in, random_bits
from apollonius.play.replay import as_rows, as_state, load_replay, play_actions, save_replay

GAMES = 24
PAPER = make_game("paper")
PLAYERS = BySide(find_player("P_stage1", Role.PURSUER, PAPER), find_player("random", Role.EVADER, PAPER))
MATCH = Match(make_game("paper"), PLAYERS, GAMES, seed=3)


def test_a_trace_is_the_course_of_the_game_that_was_played_out():
    results = play_games(MATCH)
    for index in range(0, GAMES, 12):
        course = record_game(MATCH, index)
        assert (course.outcome, len(course.actions)) == (results.outcome[index], results.steps[index])
        assert course.first_difference() is None
    assert len(set(results.steps[::12].tolist())) > 1


@pytest.fixture(scope="module")
def replay():
    return record_game(MATCH, index=2)


@pytest.fixture
def path(replay, tmp_path):
    save_replay(replay, tmp_path / "replay.json")
    return tmp_path / "replay.json"


def test_a_replay_survives_its_file_and_plays_again_to_the_same_bits(replay, path):
    loaded = load_replay(path)
    assert loaded.states.dtype == np.float32
    np.testing.assert_array_equal(loaded.states, replay.states)
    np.testing.assert_array_equal(loaded.actions, replay.actions)
    assert replace(loaded, states=replay.states, actions=replay.actions, game=replay.game) == replay
    assert loaded.first_difference() is None


def test_a_game_of_both_kinds_of_players_survives_its_file_and_plays_again_to_the_same_bits(tmp_path):
    actor = make_actor("paper", 8, 1, jax.random.key(0))
    wild = Named("wild", SquashedGaussian(actor, jnp.asarray(1.0)))
    for pair in ((wild, find_player("random", Role.EVADER, PAPER)), (wild, wild)):
        kept = record_game(Match(make_game("paper"), BySide(*pair), games=4, seed=3), index=2)
        assert kept.actions.shape == (len(kept.states) - 1, 2, 2)
        save_replay(kept, tmp_path / "both.json")
        loaded = load_replay(tmp_path / "both.json")
        np.testing.assert_array_equal(loaded.actions, kept.actions)
        assert loaded.first_difference() is None
        actions = loaded.actions.copy()
        actions[3, 1, 0] = -0.5 if actions[3, 1, 0] > 0 else 0.5
        assert replace(loaded, actions=actions).first_difference() == 4


def test_the_first_step_that_differs_is_named(path):
    loaded = load_replay(path)
    states = loaded.states.copy()
    states[7, 4] = np.nextafter(states[7, 4], np.float32(99))
    assert replace(loaded, states=states).first_difference() == 7
    actions = loaded.actions.copy()
    actions[11] = 8 - actions[11]
    assert replace(loaded, actions=actions).first_difference() == 12
    other = Outcome.NO_RESULT if loaded.outcome != Outcome.NO_RESULT else Outcome.CAPTURED
    assert replace(loaded, outcome=other).first_difference() == len(loaded.actions)


GOLDEN = sorted((Path(__file__).parents[1] / "golden").glob("*.json"))
LONGEST = 1000
"""All are played for as many steps, so that one compilation serves those of one game."""
TOLERANCE = 1e-5
"""Another processor may round a step otherwise [m, m/s, rad]."""


def play_again(replay, game):
    """States and outcomes of a replay's actions, as far as it goes."""
    actions = np.zeros((LONGEST, 2), np.int32)
    actions[: len(replay.actions)] = replay.actions
    states, outcomes = play_actions(game, as_state(jnp.asarray(replay.states[0]), jnp.asarray(0)), jnp.asarray(actions))
    return as_rows(states)[: len(replay.states)], np.asarray(outcomes)[: len(replay.actions)]


@pytest.mark.parametrize("path", GOLDEN, ids=lambda path: path.stem)
def test_golden_games_play_again(path):
    replay = load_replay(path)
    states, outcomes = play_again(replay, replay.game)
    np.testing.assert_allclose(states, replay.states, rtol=0, atol=TOLERANCE)
    assert outcomes.tolist() == [Outcome.ONGOING] * (len(outcomes) - 1) + [replay.outcome]


@pytest.mark.parametrize("key", [jax.random.key(2**31 + 5), jax.random.key(3, impl="rbg")], ids=["threefry", "rbg"])
def test_words_and_keys_are_those_of_jax(key):
    for shape in ((), (2, 512)):
        assert_array_equal(random_bits(key, shape), jax.random.bits(key, shape, jnp.uint32))
    numbers = jnp.asarray([0, 1, 2**31 - 1, -1], jnp.int32)
    ours, theirs = (jax.vmap(folded, in_axes=(None, 0))(key, numbers) for folded in (fold_in, jax.random.fold_in))
    assert jax.random.key_impl(ours) == jax.random.key_impl(key)
    assert_array_equal(jax.random.key_data(ours), jax.random.key_data(theirs))
    with jax.threefry_partitionable(False):  # two ways to count words
        assert_array_equal(random_bits(key, (5,)), jax.random.bits(key, (5,), jnp.uint32))
