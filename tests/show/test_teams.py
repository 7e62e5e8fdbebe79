"""Games of teams in pictures: a trail for each robot, its number, a sign for who is out, and who is left in words."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.presets import in_teams
from apollonius.game.types import GameState, Outcome, RobotState
from apollonius.play.replay import Replay, as_rows, play_actions
from apollonius.show.animation import frames
from apollonius.show.report import Shown
from tests.show.conftest import BLUE, RED, WHITE, colour_at
from tests.show.test_replay_player import RECORDER, run

OUT, CAUGHT = 3, 10
"""Steps at which the first pursuer leaves the walls and the second one's evader is caught."""


@pytest.fixture(scope="module")
def replay():
    """Two against two, all straight ahead: the first pursuer leaves the walls, the second catches the first evader."""
    places = [(9.75, 2, 1, 0), (2, 5, 1, 0)], [(3.15, 5.25, 0, 0), (5, 8, 1, np.pi / 2)]
    robots = BySide(*(tuple(RobotState(*map(jnp.float32, place)) for place in side) for side in places))
    game, actions = in_teams(Game(max_steps=12), 2, 2), jnp.full((12, 4), 4)
    states, outcomes = play_actions(game, GameState.at_start(robots), actions)
    end = Outcome(int(outcomes[-1]))
    return Replay(game, "P", "E", 0, 1, 0, as_rows(jax.device_get(states)), np.asarray(actions), end)


def test_who_is_in_play_is_known_for_each_state(replay):
    steps = replay.in_play().sum(axis=0)
    assert steps.tolist() == [OUT, 13, CAUGHT, 13]
    shown = Shown(replay, 1).to_dict()
    assert shown["until"] == [OUT, None, CAUGHT, None]


def test_frames_have_all_robots_with_their_numbers_and_crosses_for_those_out(replay, words_of):
    said = words_of(replay, [0, 12])
    assert said[:3] == ["capture within 0.3 m", "2 pursuers P", "2 evaders E"]
    assert said[3:9] == ["1", "2", "1", "2", "0.0 s", "2 v 2 in play, distance 1.18 m"]
    first, last = frames(replay, [0, 12])
    apart = np.hypot(replay.states[-1, 12] - replay.states[-1, 4], replay.states[-1, 13] - replay.states[-1, 5])
    assert said[9:] == ["2", "2", "no result after 1.2 s", f"1 v 1 in play, distance {apart:.2f} m"]

    beside = 0.09  # m; in an arrowhead
    assert [colour_at(first, 9.75 - beside, 2), colour_at(first, 2 - beside, 5)] == [RED, RED]
    x, y = replay.states[-1, 8:10]
    assert colour_at(last, x, y) == BLUE
    assert WHITE not in (colour_at(last, x + 0.07, y + 0.07), colour_at(last, x - 0.07, y - 0.07))
    assert colour_at(last, x, y + 0.14) == WHITE, "off the arms of a cross, outside the ring of its start"
    x, y = replay.states[-1, 4:6]
    assert colour_at(last, x - beside, y + 0.05) == RED


def test_the_page_draws_every_robot_and_says_who_is_left(replay, tmp_path):
    script = (
        RECORDER
        + """
player.drawGame(canvas, game.game, states, 12, colours);
const marks = calls.filter(([name]) => name === "fillText").map((call) => call[1]);
const reaches = calls.filter(([name, , , radius]) => name === "arc" && radius === 0.3).length;
console.log(JSON.stringify([marks, reaches, player.facts(game.game, states[0]), player.facts(game.game, states[12])]));
"""
    )
    marks, reaches, first, last = run(tmp_path, script, Shown(replay, 1).to_dict())
    assert (marks, reaches) == (["1", "2", "1", "2"], 1)
    assert first == "distance 1.18 m · 2 v 2 in play"
    assert last.endswith("1 v 1 in play")
