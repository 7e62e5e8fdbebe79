"""The script that draws games: the states between steps, and what is drawn where. Node runs it, where there is one."""

import json
import shutil
import subprocess

import pytest

from apollonius.show.report import bundled
from tests.documents import REPOSITORY

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
    (tmp_path / "replay.mjs").write_text(bundled(REPOSITORY / "apollonius" / "show" / "replay.js"))
    head = 'import * as player from "./replay.mjs";\nconst game = ' + json.dumps(game) + ";\n"
    (tmp_path / "test.mjs").write_text(head + script)
    done = subprocess.run(["node", "test.mjs"], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=60)
    return json.loads(done.stdout)


def drawn(calls, name, colour):
    """Arguments of the calls of one kind that were made in a colour, filled or stroked."""
    return [call[1:-2] for call in calls if call[0] == name and colour in call[-2:]]


def test_robots_discs_and_the_reach_of_a_capture_are_drawn_in_metres_between_two_steps(tmp_path):
    script = RECORDER + (
        "player.drawGame(canvas, game.game, states, 0.5, colours);\nconsole.log(JSON.stringify([canvas, calls]))"
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


def test_layers_are_those_of_the_page(tmp_path):
    """Nine dots are crossed out where a robot at full speed, half a metre before the wall, can no longer stop."""
    row = [9.5, 2, 1.2, 0, 5, 8, 0, 0]
    game = GAME | {"states": [row, row, row]}
    script = RECORDER + (
        "const count = (shown) => { calls.length = 0; player.drawGame(canvas, game.game, states, 0, colours, shown);"
        " return calls.filter(([name]) => name === 'lineTo').length; };\n"
        "globalThis.OffscreenCanvas = class { getContext() { return context; } };\n"
        "const counts = [[], ['brakes'], ['regions']].map(count);\n"
        "console.log(JSON.stringify([counts, calls.filter(([name]) => name === 'drawImage').length]))"
    )
    (bare, brakes, _), images = run(tmp_path, script, game)
    assert brakes - bare == 9 * 2 * 2
    assert images == 1
