"""The page in Firefox: a person plays a game to its end by keys, and sees why; draws an arena, and plays there."""

import base64
import json

import pytest

from apollonius.arenas.file import load_game
from apollonius.arenas.record import to_dict
from apollonius.play.replay import load_replay
from tests.web.firefox import needs_firefox, opened
from tests.web.scripts import DROP, PLACING, spot

UP, SPACE = "\ue013", " "
PHASE = "document.body.dataset.phase"
pytestmark = [needs_firefox, pytest.mark.slow]


def listen(tab):
    """Keep what the page complains about."""
    tab.evaluate("window.complaints = []")
    tab.evaluate("window.addEventListener('error', ({ message }) => window.complaints.push(message))")


def test_a_person_plays_in_firefox(address, tmp_path):
    with opened(tmp_path) as tab:
        tab.open(f"{address}?pursuer=P_any&evader=you&game=maze")
        tab.wait_for(f"{PHASE} === 'ready'")
        listen(tab)
        tab.evaluate("apollonius.page.match.game.max_steps = 30")
        tab.keys(("keyDown", "v"), ("keyUp", "v"), ("keyDown", UP), ("keyDown", SPACE), ("keyUp", SPACE))
        tab.wait_for(f"{PHASE} === 'over'")
        tab.keys(("keyUp", UP))
        assert tab.evaluate("document.getElementById('message').textContent").startswith("You survived after 3.0")
        assert 7 in [evader for _, evader in tab.evaluate("apollonius.page.match.actions")]
        assert tab.evaluate("document.getElementById('why').getAttribute('aria-pressed')") == "true"
        tab.click("#draw")
        tab.wait_for(f"{PHASE} === 'drawing'")
        tab.click("#play-here")
        tab.wait_for(f"{PHASE} === 'ready'")
        assert tab.evaluate("window.complaints") == []


def test_an_arena_is_drawn_shared_and_played_to_its_end(address, floor, tmp_path):
    profile = tmp_path / "profile"
    profile.mkdir()
    with opened(profile) as tab:
        tab.open(f"{address}?pursuer=P_any&evader=you")
        tab.wait_for(f"{PHASE} === 'ready'")
        tab.click("#draw")
        tab.wait_for(f"{PHASE} === 'drawing'")
        tab.click("#clear")
        placing = tab.evaluate(f"({PLACING})({{ x_min: 0, x_max: 10, y_min: 0, y_max: 10 }})")
        for tool, start, end in (("disc", (2, 8), (2.6, 8)), ("block", (6, 6), (7, 8)), ("wall", (1, 3), (7, 3))):
            tab.click(f"#tools [data-tool={tool}]")
            tab.drag(spot(placing, *start), spot(placing, *end))
        saved = tab.download("#save")
        game = load_game(saved)
        assert (len(game.arena.discs), len(game.arena.polygons)) == (1, 2)
        tab.click("#share")
        link = tab.evaluate("location.hash")
        tab.click("#clear")
        tab.choose("#file", saved)
        tab.wait_for("document.getElementById('file').value === ''")  # it is emptied when the file is read
        assert to_dict(load_game(tab.download("#save"))) == to_dict(game)

        tab.open("about:blank")
        tab.open(address + link)
        tab.wait_for(f"{PHASE} === 'ready'")
        listen(tab)
        assert tab.evaluate("apollonius.page.match.players.pursuer[0].name") == "shielded:P_any"
        tab.keys(("keyDown", SPACE), ("keyUp", SPACE))
        tab.wait_for(f"{PHASE} === 'playing'")
        tab.evaluate("(() => { const { match } = apollonius.page; while (!match.isOver) match.step(); })()")
        tab.wait_for(f"{PHASE} === 'over'")
        assert tab.evaluate("document.getElementById('message').textContent").startswith("You were caught")
        replay = load_replay(tab.download("#download"))
        assert replay.pursuer == "shielded:P_any"
        assert replay.first_difference() is None

        files = [(path.name, base64.b64encode(path.read_bytes()).decode()) for path in floor]
        tab.evaluate(f"({DROP})({json.dumps(files)})")
        tab.wait_for(f"{PHASE} === 'drawing' && !document.getElementById('play-here').disabled")
        tab.click("#play-here")
        tab.wait_for(f"{PHASE} === 'ready'")
        assert tab.evaluate("apollonius.page.match.game.arena.map.file") == "floor.yaml"
        assert tab.evaluate("window.complaints") == []
