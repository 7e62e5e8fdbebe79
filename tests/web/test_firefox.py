"""The page in Firefox: a person plays a game to its end by keys, and sees why."""

import pytest

from tests.web.firefox import needs_firefox, opened

UP, SPACE = "\ue013", " "
PHASE = "document.body.dataset.phase"


@needs_firefox
@pytest.mark.slow
def test_a_person_plays_in_firefox(address, tmp_path):
    with opened(tmp_path) as tab:
        tab.open(f"{address}?pursuer=P_any&evader=you&game=maze")
        tab.wait_for(f"{PHASE} === 'ready'")
        tab.evaluate("window.complaints = []")
        tab.evaluate("window.addEventListener('error', ({ message }) => window.complaints.push(message))")
        tab.evaluate("apollonius.page.match.game.max_steps = 30")
        tab.keys(("keyDown", "v"), ("keyUp", "v"), ("keyDown", UP), ("keyDown", SPACE), ("keyUp", SPACE))
        tab.wait_for(f"{PHASE} === 'over'")
        tab.keys(("keyUp", UP))
        assert tab.evaluate("document.getElementById('message').textContent").startswith("You survived after 3.0")
        assert 7 in [evader for _, evader in tab.evaluate("apollonius.page.match.actions")]
        assert tab.evaluate("document.getElementById('why').getAttribute('aria-pressed')") == "true"
        tab.click("draw")
        tab.wait_for(f"{PHASE} === 'drawing'")
        tab.click("play-here")
        tab.wait_for(f"{PHASE} === 'ready'")
        assert tab.evaluate("window.complaints") == []
