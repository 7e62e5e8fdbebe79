"""The page in headless Chromium, by a clock that tests turn: seconds of a game take no longer than its steps."""

import shutil

import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install playwright")
CHROMIUM = shutil.which("chromium")
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="needs chromium: install it")
FLAGS = (
    "--no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync"
)
DESK = {"viewport": {"width": 840, "height": 560}}
PHONE = {"viewport": {"width": 375, "height": 667}, "is_mobile": True, "has_touch": True}
LONGEST_FRAME = 250
"""Time [ms] that the page takes at most for one frame."""


class Tab:
    """One tab in which pages are opened one after the other; `complaints` are those of the page that is open."""

    def __init__(self, browser, address, **screen):
        self.address, self.complaints = address, []
        self.page = browser.new_context(**screen).new_page()
        self.page.on("console", lambda message: message.type == "error" and self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.clock.install(time=0)
        self.page.clock.pause_at(1)

    def open(self, query=""):
        """The page, loaded anew, ready to be started, and with nothing remembered."""
        self.page.goto("about:blank")  # where only the fragment differs, nothing would be loaded
        self.page.goto(self.address + query)
        self.page.wait_for_selector("#go:enabled")
        self.page.evaluate("localStorage.clear()")
        self.complaints.clear()
        return self.page

    def let_pass(self, seconds):
        """So much time of the page's clock."""
        for _ in range(round(1000 * seconds / LONGEST_FRAME)):
            self.page.clock.fast_forward(LONGEST_FRAME)

    def play(self, seconds):
        """Press the button, and see a person's game to so many seconds."""
        self.page.click("#go")
        self.let_pass(1.5 + seconds)

    def end_after(self, steps):
        """The game with a limit of so few steps, played to it."""
        self.page.evaluate(f"apollonius.page.match.game.max_steps = {steps}")
        self.play(1)
        self.page.wait_for_selector("body[data-phase=over]")

    def finish(self):
        """The rest of the match at once, and the page that shows its end."""
        self.page.evaluate("() => { const { match } = apollonius.page; while (!match.isOver) match.step(); }")
        self.let_pass(0.5)
        self.page.wait_for_selector("body[data-phase=over]")

    def save(self, path, button="#download"):
        """The file that a button gives."""
        with self.page.expect_download() as download:
            self.page.click(button)
        download.value.save_as(path)
        return path

    def match(self, what):
        """Something of the match, such as `state.evader[0]`."""
        return self.page.evaluate(f"apollonius.page.match.{what}")
