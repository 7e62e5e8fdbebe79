"""The page in a real browser: a person plays a game to its end, and its replay plays again in Python."""

import json
import re
import shutil
from contextlib import contextmanager

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.network import make_network
from apollonius.agents.store import describe, save_agent
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.game.types import Role
from apollonius.replay import load_replay
from apollonius.web.site import Choice, write_site
from tests.web.test_server import serving

playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs chromium")
FLAGS = (
    "--no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync"
)
PIXEL = """share => {
  const canvas = document.getElementById("canvas");
  return [...canvas.getContext("2d").getImageData(0.3 * canvas.width, share * canvas.height, 1, 1).data];
}"""
PHONE = {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True}


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    write_site(folder, Choice(pursuer="shielded:P_pool", evader="you"))
    with serving(folder) as server:
        yield f"http://localhost:{server.server_port}/"


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS.split())
        yield chromium
        chromium.close()


@contextmanager
def opened(browser, address, **screen):
    """The page, loaded; afterwards it must have complained about nothing."""
    context = browser.new_context(**screen)
    page = context.new_page()
    complaints = []
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(address)
    page.wait_for_selector("#go:enabled")
    yield page
    context.close()
    assert complaints == []


def evader(page):
    return page.evaluate("apollonius.page.match.state.evader")


def clock(page):
    return float(page.inner_text("#clock"))


def wait_for_clock(page, seconds):
    playwright.expect(page.locator("#clock")).to_have_text(re.compile(rf"^{seconds}"), timeout=20_000)


def test_a_person_plays_a_game_to_its_end(browser, address, tmp_path):
    with opened(browser, address) as page:
        before = evader(page)
        page.keyboard.press("Space")
        page.keyboard.down("ArrowUp")
        wait_for_clock(page, 1)
        assert evader(page)["v"] > before["v"]
        page.keyboard.down("ArrowLeft")
        wait_for_clock(page, 2)
        page.keyboard.up("ArrowLeft")
        assert evader(page)["heading"] != before["heading"]
        page.wait_for_selector("#download:enabled", timeout=30_000)
        assert page.inner_text("#message") == (
            f"The evader has run into a wall after {clock(page):.1f} s: shielded:P_pool wins."
        )
        assert page.inner_text("#pursuer-score") == "1"
        with page.expect_download() as download:
            page.click("#download")
        download.value.save_as(tmp_path / "game.json")
    replay = load_replay(tmp_path / "game.json")
    assert download.value.suggested_filename == "game-1-evader_out_of_range.json"
    assert (replay.pursuer, replay.evader, replay.outcome.name) == ("shielded:P_pool", "you", "EVADER_OUT_OF_RANGE")
    assert {7, 8} <= set(replay.actions[:, 1].tolist())
    assert replay.first_difference() is None


def test_pause_restart_and_new_start(browser, address):
    with opened(browser, address) as page:
        first = evader(page)
        page.keyboard.press("Space")
        wait_for_clock(page, "0.[5-9]")
        page.keyboard.press("Space")
        playwright.expect(page.locator("#message")).to_have_text("Paused")
        page.wait_for_timeout(200)  # the last step is drawn
        stopped = clock(page)
        page.wait_for_timeout(400)
        assert clock(page) == stopped
        page.click("#again")
        playwright.expect(page.locator("#clock")).to_have_text("0.0")
        assert evader(page) == first
        page.click("#next")
        assert evader(page) != first


def test_choices_change_the_game_and_the_address(browser, address):
    with opened(browser, address) as page:
        page.select_option("#evader", "E_scratch")
        page.select_option("#game", "one-large")
        page.fill("#seed", "7")
        page.press("#seed", "Enter")
        page.wait_for_selector("#go:enabled")
        page.click("#go")
        wait_for_clock(page, 1)
        assert page.evaluate("apollonius.page.match.game.arena.discs.length") == 1
        assert page.evaluate("apollonius.timing.move.durations.length") >= 20
        chosen, state = page.url, page.evaluate("apollonius.page.match.start")
        assert chosen.endswith("?pursuer=shielded%3AP_pool&evader=E_scratch&game=one-large&seed=7")
    with opened(browser, chosen) as page:
        assert page.evaluate("apollonius.page.match.start") == state


def test_a_finger_on_the_pad_steers(browser, address):
    with opened(browser, address, **PHONE) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        before = evader(page)
        page.click("#go")
        box = page.locator("#pad").bounding_box()
        page.mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 0.1 * box["height"])
        page.mouse.down()
        wait_for_clock(page, 1)
        page.mouse.up()
        after = evader(page)
        assert after["v"] > before["v"]
        turned = (after["heading"] - before["heading"] + 3.14159) % 6.28318 - 3.14159
        assert -2 < turned < -0.4


def test_two_people_have_keys_of_their_own(browser, address):
    with opened(browser, f"{address}?pursuer=you&evader=you") as page:
        page.keyboard.press("Space")
        page.keyboard.down("KeyW")
        wait_for_clock(page, 1)
        assert page.evaluate("apollonius.page.match.state.pursuer.v") > 0.1
        assert evader(page)["v"] == 0


@pytest.fixture(scope="module")
def own_map(tmp_path_factory):
    """The address of a page with a game on a map, and an untrained pursuer that plays in any arena."""
    folder = tmp_path_factory.mktemp("own")
    occupied = np.zeros((80, 120), bool)
    occupied[30:34, :90] = True
    field = jnp.asarray(distance_field(occupied, 0.1))
    floor = OccupancyMap(field, -1.0, 2.0, 0.1, str(folder / "floor.yaml"), "0" * 64)
    game = Game(arena=Arena(-1.0, 11.0, 2.0, 10.0, map=floor))
    network = make_network("egocentric", 16, 2, jax.random.key(0))
    save_agent(describe(network, Role.PURSUER, {}, {}), folder / "small.safetensors")
    agents = {"small": folder / "small.safetensors"}
    write_site(folder / "site", Choice("small", "still", "hall", agents=agents, games={"hall": game}))
    with serving(folder / "site") as server:
        yield f"http://localhost:{server.server_port}/"


@pytest.mark.parametrize("game", ["hall", "maze"])
def test_an_agent_that_knows_no_arena_plays_in_any(browser, own_map, game, tmp_path):
    with opened(browser, own_map) as page:
        page.select_option("#game", game)
        page.wait_for_selector("#go:enabled")
        page.click("#go")
        wait_for_clock(page, 1)
        assert page.evaluate("apollonius.timing.move.durations.length") >= 10
        replay = page.evaluate(
            "() => { const { match } = apollonius.page; while (!match.isOver) match.step(); return match.replay(); }"
        )
        block, aisle = (page.evaluate(PIXEL, share) for share in (0.6, 0.2))
    assert replay["pursuer"] == "small"
    if game == "hall":
        assert block != aisle
        assert set(replay["game"]["arena"]["map"]) == {"file", "sha256"}
    else:
        (tmp_path / "game.json").write_text(json.dumps(replay))
        assert load_replay(tmp_path / "game.json").first_difference() is None


def test_an_agent_that_cannot_be_loaded_is_said(browser, address):
    context = browser.new_context()
    page = context.new_page()
    page.route("**/agents/*", lambda route: route.fulfill(status=404))
    page.goto(address)
    playwright.expect(page.locator("#message")).to_have_text(re.compile("P_pool cannot be loaded"))
    assert page.is_disabled("#go")
    page.select_option("#pursuer", "random")
    page.wait_for_selector("#go:enabled")
    context.close()
