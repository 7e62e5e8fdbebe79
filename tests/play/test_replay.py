"""A game step by step, and its file: it plays again to the same bits, or the first step that differs is named."""

import json
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.greedy import SquashedGaussian
from apollonius.agents.kind import Named
from apollonius.agents.network import make_actor
from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, play_games, record_game
from apollonius.game.by_side import BySide
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.play.replay import load_replay, save_replay

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
    data = json.loads((tmp_path / "both.json").read_text())
    data["actions"][2][0][1] = 1.5
    (tmp_path / "both.json").write_text(json.dumps(data))
    with pytest.raises(InvalidInput, match="from -1 to 1"):
        load_replay(tmp_path / "both.json")


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


def with_action(data, action):
    return {"actions": [*data["actions"][:3], [0, action], *data["actions"][4:]]}


@pytest.mark.parametrize(
    ("changes", "naming"),
    [
        (lambda data: {"format": 2}, "format = 2 .*1, as this version reads"),
        (lambda data: {"actions": [[0, 8]]}, "a row of 8 more than actions"),
        (lambda data: with_action(data, 9), "from 0 to 8"),
        (lambda data: {"outcome": "flew away"}, "outcome = flew away .* how a game can end"),
        (lambda data: {"game": {"dt": -1.0}}, "dt = -1.0"),
        (lambda data: {"game": {"wind": 1.0}}, "'wind' is no known key"),
        (lambda data: {"states": None}, "no replay: .*states"),
    ],
    ids=["format", "shape", "action", "outcome", "rules", "key", "states"],
)
def test_what_is_no_replay_is_refused(path, changes, naming):
    data = json.loads(path.read_text())
    path.write_text(json.dumps(data | changes(data)))
    with pytest.raises(InvalidInput, match=naming):
        load_replay(path)


def test_a_broken_and_a_missing_file_are_refused(path):
    path.write_text("{")
    with pytest.raises(InvalidInput, match="is no replay"):
        load_replay(path)
    path.unlink()
    with pytest.raises(InvalidInput, match="check the path"):
        load_replay(path)
