"""The script that draws games: the states between steps, and what is drawn where. Node runs it, where there is one."""

import json
import shutil
import subprocess

import pytest

from apollonius.show.report.page import replay_script

pytestmark = pytest.mark.skipif(not shutil.which("node"), reason="needs node")

ARENA = {"x_min": 0, "x_max": 10, "y_min": 0, "y_max": 10, "discs": [{"x": 3, "y": 4, "radius": 0.5}]}
ARENA |= {"polygons": [{"vertices": [[6, 6], [8, 6], [7, 8]]}]}
STATES = [[1, 2, 0.5, 3.0, 8, 8, 1, 0], [2, 2, 0.7, -3.0, 8, 7, 1, 0], [3, 2, 0.7, -3.0, 8, 6, 1, 0]]
GAME = {"game": {"arena": ARENA, "dt": 0.1, "capture_distance": 0.3}, "states": STATES}

RECORDER = """
const calls = [];
const context = new Proxy({}, {
  get: (target, name) => target[name] ?? ((...given) => calls.push([name, ...given, target.fillStyle])),
});
"""


def run(tmp_path, script, game=GAME):
    """What a script prints that knows the player's functions."""
    (tmp_path / "replay.mjs").write_text(replay_script())
    head = 'import * as player from "./replay.mjs";\nconst game = ' + json.dumps(game) + ";\n"
    (tmp_path / "test.mjs").write_text(head + script)
    done = subprocess.run(["node", "test.mjs"], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=60)
    return json.loads(done.stdout)


def test_states_between_steps_lie_between_them_and_headings_turn_the_short_way(tmp_path):
    script = "console.log(JSON.stringify([0, 0.5, 2, 2.7].map((step) => player.stateAt(game.states, step))))"
    first, between, last, beyond = run(tmp_path, script)
    assert first == STATES[0]
    assert last == beyond == STATES[2]
    assert between[:3] == pytest.approx([1.5, 2, 0.6])
    assert abs(between[3]) == pytest.approx(3.14159, abs=1e-4)


def test_robots_discs_and_the_reach_of_a_capture_are_drawn_to_scale(tmp_path):
    script = RECORDER + (
        "const colours = { pursuer: 'red', evader: 'blue', obstacle: 'grey', paper: 'white' };\n"
        "player.drawGame(context, 460, 460, game, 1, colours);\n"
        "console.log(JSON.stringify(calls))"
    )
    calls = run(tmp_path, script)
    scale, margin = 40, 30
    arcs = [call[1:4] for call in calls if call[0] == "arc"]
    assert [margin + 3 * scale, margin + 6 * scale, 0.5 * scale] in arcs
    assert [margin + 2 * scale, margin + 8 * scale, 0.3 * scale] in arcs
    corners = [call[1:3] for call in calls if call[0] == "lineTo" and call[-1] == "grey"]
    assert corners == [[margin + x * scale, margin + (10 - y) * scale] for x, y in ((6, 6), (8, 6), (7, 8))]
    assert not [call for call in calls if call[0] == "fillText" and "map" in str(call[1])]
    letters = {call[1]: (call[2:4], call[-1]) for call in calls if call[0] == "fillText" and call[1] in ("P", "E")}
    assert letters["P"] == ([margin + 2 * scale, margin + 8 * scale + 0.5], "white")
    assert letters["E"] == ([margin + 8 * scale, margin + 3 * scale + 0.5], "white")
    assert ["setLineDash", [6, 4]] in [call[:2] for call in calls]
    assert "10 m" in [call[1] for call in calls if call[0] == "fillText"]


def test_a_territory_is_drawn_and_a_map_is_said_to_be_left_out(tmp_path):
    arena = 'const other = { ...game.game.arena, territory: { x: 5, y: 5, radius: 1 }, map: { file: "floor.yaml" } };\n'
    script = (
        arena
        + RECORDER
        + (
            "const colours = { pursuer: 'red', evader: 'blue', obstacle: 'grey', paper: 'white' };\n"
            "player.drawGame(context, 460, 460, { ...game, game: { ...game.game, arena: other } }, 1, colours);\n"
            "console.log(JSON.stringify(calls))"
        )
    )
    calls = run(tmp_path, script)
    assert [30 + 5 * 40, 30 + 5 * 40, 40] in [call[1:4] for call in calls if call[0] == "arc"]
    assert "the occupancy map of this arena is not shown here" in [call[1] for call in calls if call[0] == "fillText"]
