"""The script that draws games, in Node, where there is one; and games of teams, as it and animations draw them."""

import json
import shutil
import subprocess

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.game import Game
from apollonius.game.presets import in_teams
from apollonius.game.types import BySide, GameState, Outcome, RobotState
from apollonius.play.replay import Replay, as_rows, play_actions
from apollonius.show.animation import frames
from apollonius.show.report import bundled, for_page
from tests.documents import REPOSITORY
from tests.show.conftest import BLUE, RED, WHITE, colour_at

pytestmark = pytest.mark.skipif(not shutil.which("node"), reason="needs node")

ARENA = {"x_min": 0, "x_max": 10, "y_min": 0, "y_max": 10, "discs": [{"x": 3, "y": 4, "radius": 0.5}]}
ARENA |= {"polygons": [{"vertices": [[6, 6], [8, 6], [7, 8]]}]}
STATES = [[1, 2, 0.5, 3.0, 8, 8, 1, 0], [2, 2, 0.7, -3.0, 8, 7, 1, 0], [3, 2, 0.7, -3.0, 8, 6, 1, 0]]
BODY = {"v_min": 0, "v_max": 1.2, "u1_max": 0.3, "u2_max": 0.8, "radius": 0}
RULES = {"arena": ARENA, "pursuer": BODY, "evader": BODY, "dt": 0.1, "capture_distance": 0.3}
GAME = {"game": RULES, "states": STATES}

RECORDER = """
const calls = [];
const context = new Proxy({}, {
  get(target, name) {
    return target[name] ?? ((...given) => calls.push([name, ...given, target.fillStyle, target.strokeStyle]));
  },
});
const canvas = { clientWidth: 420, clientHeight: 420, getContext: () => context };
globalThis.devicePixelRatio = 2;
const colours = { pursuer: "red", evader: "blue", obstacle: "grey", paper: "white", ink: "black", grid: "pale" };
const states = player.statesOf(game);
"""
"""A canvas that keeps what is drawn on it, and the states of a game."""


def run(tmp_path, script, game=GAME):
    """What a script prints that knows the player's functions."""
    script_of_report = bundled(REPOSITORY / "apollonius" / "show" / "replay.js")
    (tmp_path / "replay.mjs").write_text(f"{script_of_report}export {{ draw }};\n")
    head = 'import * as player from "./replay.mjs";\nconst game = ' + json.dumps(game) + ";\n"
    (tmp_path / "test.mjs").write_text(head + script)
    done = subprocess.run(["node", "test.mjs"], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=60)
    return json.loads(done.stdout)


def drawn(calls, name, colour):
    """Arguments of the calls of one kind that were made in a colour, filled or stroked."""
    return [call[1:-2] for call in calls if call[0] == name and colour in call[-2:]]


def test_robots_discs_and_the_reach_of_a_capture_are_drawn_in_metres_between_two_steps(tmp_path):
    script = RECORDER + (
        "player.draw(canvas, { ...game, states, at: 0.5, colours });\nconsole.log(JSON.stringify([canvas, calls]))"
    )
    canvas, calls = run(tmp_path, script)
    assert (canvas["width"], canvas["height"]) == (840, 840)
    (scale, _, _, upwards, x, y) = next(call[1:7] for call in calls if call[0] == "setTransform")
    assert (scale, upwards, x, y) == (80, -80, 20, 820)
    assert [3, 4, 0.5] in [call[:3] for call in drawn(calls, "arc", "grey")]
    assert drawn(calls, "lineTo", "grey")[:3] == [[6, 6], [8, 6], [7, 8]]
    assert [1.5, 2, 0.3] in [call[:3] for call in drawn(calls, "arc", "red")]
    assert [8, 7.5] in [call[:2] for call in drawn(calls, "arc", "blue")]
    nose = drawn(calls, "lineTo", "red")[-4]
    assert nose[0] < 1.5, "it turns the short way, and looks to the left"
    assert nose[1] == pytest.approx(2, abs=1e-3)


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
    shown = for_page(replay)
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


def test_the_report_draws_every_robot(replay, tmp_path):
    script = (
        RECORDER
        + """
player.draw(canvas, { ...game, states, at: 12, colours });
const marks = calls.filter(([name]) => name === "fillText").map((call) => call[1]);
const reaches = calls.filter(([name, , , radius]) => name === "arc" && radius === 0.3).length;
console.log(JSON.stringify([marks, reaches]));
"""
    )
    assert run(tmp_path, script, for_page(replay)) == [["1", "2", "1", "2"], 1]
