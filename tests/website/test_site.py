"""The whole site, built and opened in a real browser: from a folder, and below a path of a web host."""

import subprocess
import sys
import threading
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest

from tests.documents import REPOSITORY
from tests.web.browser import PHONE, needs_chromium, playwright

pytest.importorskip("sphinx", reason="needs what make site installs")
pytestmark = [pytest.mark.slow, needs_chromium]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder, below another one. Building it fails on a warning."""
    folder = tmp_path_factory.mktemp("host") / "below" / "site"
    subprocess.run([sys.executable, "-m", "website", "--out", folder], cwd=REPOSITORY, check=True, timeout=550)
    return folder


@pytest.fixture(scope="module", params=["file", "http"])
def address(request, site):
    if request.param == "file":
        yield site.as_uri()
        return
    handler = partial(SimpleHTTPRequestHandler, directory=site.parents[1])
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/below/site"
        server.shutdown()


@contextmanager
def open_page(browser, address, page, **screen):
    """A page of the site; afterwards it must have asked no other host, and made no error."""
    context = browser.new_context(**screen)
    tab = context.new_page()
    asked, errors = [], []
    tab.on("request", lambda request: asked.append(request.url))
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.goto(f"{address}/{page}")
    yield tab
    context.close()
    assert [url for url in asked if not url.startswith((address, "data:", "blob:"))] == []
    assert errors == []


@pytest.mark.parametrize("screen", [{}, PHONE], ids=["desktop", "phone"])
def test_home_page_has_six_learning_pursuers_and_a_game(browser, address, screen):
    with open_page(browser, address, "index.html", **screen) as tab:
        lesson = tab.frame_locator(".hero iframe")
        lesson.locator("#go:enabled").wait_for()
        first = lesson.locator("#six button").first
        box, height = first.bounding_box(), tab.viewport_size["height"]
        assert box["y"] + box["height"] < height, "without scrolling"
        playwright.expect(lesson.locator("#six button[data-outcome=caught]").first).to_be_visible(timeout=30_000)
        tab.locator("iframe.wide").scroll_into_view_if_needed()
        game = tab.frame_locator("iframe.wide")
        game.locator("#go:enabled").wait_for()
        assert game.locator("#goal").inner_text().startswith("1. ")
        game.locator("#go").click()
        playwright.expect(game.locator("#go")).to_have_text("Pause", timeout=20_000)


@pytest.mark.parametrize("screen", [{}, PHONE], ids=["desktop", "phone"])
def test_home_page_leads_to_full_screen_games(browser, address, screen):
    with open_page(browser, address, "index.html", **screen) as tab:
        tab.locator(".ways a").click()
        tab.locator("#go:enabled").wait_for()
        assert tab.inner_text("#goal").startswith("1. ")
        tab.locator("#lead").click()
        game = tab.frame_locator(".hero iframe")
        game.locator("#go:enabled").wait_for()
        game.locator("#menu").click()
        game.locator("#levels button").nth(4).click()
        game.locator("#goal", has_text="5. ").wait_for()
        game.locator("#lead").click()
        tab.locator("#go:enabled").wait_for()
        assert tab.inner_text("#goal").startswith("5. "), "another level, chosen in the frame"


def test_gallery_leads_to_a_game_in_its_arena(browser, address):
    with open_page(browser, address, "reference/arenas.html") as tab:
        tab.locator("a.play[href*=office]").click()
        tab.locator("#go:enabled").wait_for()
        assert tab.evaluate("apollonius.page.match.game.arena.polygons.length") == 12


def test_search_finds_the_reference_page(browser, address):
    with open_page(browser, address, "search.html?q=Unicycle") as tab:
        tab.locator("#search-results li a").first.wait_for()
        links = tab.locator("#search-results li a").evaluate_all("links => links.map(link => link.href)")
        assert any("reference/api/game.html" in link for link in links)
