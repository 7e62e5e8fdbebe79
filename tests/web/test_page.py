"""The page in a real browser: a person plays a game to its end, and its replay plays again in Python."""

import itertools
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
    write_site(folder, Choice(pursuer="shielded:P_pool", evader="you", difficulty="sharp"))
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


def wait_for_seconds(page, seconds):
    """Until so many seconds of the game have been played."""
    for _ in range(400):  # the page's policy lets no driver wait inside of it
        if page.evaluate("apollonius.page.match.seconds") >= seconds:
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"{seconds} s are not over")


def ended_after(page, steps):
    """The game with a limit of so few steps, played to it."""
    page.evaluate(f"apollonius.page.match.game.max_steps = {steps}")
    page.click("#go")
    page.wait_for_selector("body[data-phase=over]")


def test_a_person_plays_a_game_to_its_end(browser, address, tmp_path):
    with opened(browser, address) as page:
        before = evader(page)
        page.keyboard.press("Space")
        page.keyboard.down("ArrowUp")
        wait_for_seconds(page, 1)
        assert evader(page)["v"] > before["v"]
        page.keyboard.down("ArrowLeft")
        wait_for_seconds(page, 2)
        page.keyboard.up("ArrowLeft")
        assert evader(page)["heading"] != before["heading"]
        page.wait_for_selector("#download:enabled", timeout=30_000)
        seconds = page.evaluate("apollonius.page.match.seconds")
        said = f"You ran into a wall after {seconds:.1f}\u00a0s. You lose. Your best so far."
        assert page.inner_text("#message") == said
        assert page.inner_text("#go") == "Try again"
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
        playwright.expect(page.locator("#message")).to_have_text("3")
        wait_for_seconds(page, 0.5)
        page.keyboard.press("Space")
        playwright.expect(page.locator("#message")).to_have_text("Paused")
        stopped = page.evaluate("apollonius.page.match.seconds")
        page.wait_for_timeout(400)
        assert page.evaluate("apollonius.page.match.seconds") == stopped
        page.click("#again")
        playwright.expect(page.locator("#clock")).to_have_text("100.0")
        assert evader(page) == first
        page.click("#next")
        assert evader(page) != first


def test_choices_change_the_game_and_the_address(browser, address):
    with opened(browser, address) as page:
        page.click("#menu")
        page.select_option("#game", "one-large")
        page.select_option("#evader", "E_scratch")
        page.select_option("#pursuer", "P_pool")
        page.uncheck("#shield")
        page.fill("#seed", "7")
        page.press("#seed", "Enter")
        page.wait_for_selector("#go:enabled")
        page.keyboard.press("Space")
        wait_for_seconds(page, 1)
        assert page.evaluate("apollonius.page.match.game.arena.discs.length") == 1
        assert page.evaluate("apollonius.timing.move.durations.length") >= 20
        chosen, state = page.url, page.evaluate("apollonius.page.match.start")
        assert chosen.endswith("?pursuer=P_pool&evader=E_scratch&game=one-large&difficulty=sharp&seed=7")
    with opened(browser, chosen) as page:
        assert page.evaluate("apollonius.page.match.start") == state


def test_a_finger_on_the_pad_steers(browser, address):
    with opened(browser, address, **PHONE) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        before = evader(page)
        page.click("#go")
        box = page.locator("#pad-evader").bounding_box()
        page.mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 0.1 * box["height"])
        page.mouse.down()
        wait_for_seconds(page, 1)
        page.mouse.up()
        after = evader(page)
        assert after["v"] > before["v"]
        turned = (after["heading"] - before["heading"] + 3.14159) % 6.28318 - 3.14159
        assert -2 < turned < -0.4


def test_two_people_have_keys_of_their_own(browser, address):
    with opened(browser, f"{address}?pursuer=you&evader=you") as page:
        page.keyboard.press("Space")
        page.keyboard.down("KeyW")
        wait_for_seconds(page, 1)
        assert page.evaluate("apollonius.page.match.state.pursuer.v") > 0.1
        assert evader(page)["v"] == 0


def test_a_person_who_lasts_has_won(browser, address):
    with opened(browser, f"{address}?level=1") as page:
        assert page.inner_text("#goal") == "1. You are blue: survive 20\u00a0s"
        ended_after(page, 3)
        assert page.inner_text("#message") == "You survived after 0.3\u00a0s. You win! Your best so far."
        assert page.inner_text("#evader-score") == "1"
        page.click("#menu")
        assert "won, 0.3 s" in page.inner_text("#levels li:first-child")
        page.keyboard.press("Escape")
        page.wait_for_timeout(100)
        page.keyboard.press("Space")
        playwright.expect(page.locator("#goal")).to_have_text(re.compile("^2. You are blue: survive 40"))
        assert page.url.endswith("?level=2")


@pytest.mark.parametrize("size", [(375, 667), (667, 375)])
@pytest.mark.parametrize("people", [1, 2])
def test_a_game_is_on_one_phone_screen(browser, address, size, people):
    screen = PHONE | {"viewport": {"width": size[0], "height": size[1]}}
    other = "you" if people == 2 else "still"
    with opened(browser, f"{address}?pursuer={other}&evader=you", **screen) as page:
        pads = ["#pad-pursuer", "#pad-evader"][2 - people :]
        within(page, size, ["#clock", "#message", "#go", "#again", "#next", "#menu", *pads])
        ended_after(page, 3)
        within(page, size, ["#clock", "#message", "#go", "#download", "#replay"])


def within(page, size, names):
    """Parts of the page are wholly on the screen, beside the arena and beside each other."""
    boxes = {name: page.locator(name).bounding_box() for name in [*names, ".arena"]}
    for name, box in boxes.items():
        assert box["x"] >= 0, name
        assert box["y"] >= 0, name
        assert box["x"] + box["width"] <= size[0] + 0.5, name
        assert box["y"] + box["height"] <= size[1] + 0.5, name
    for (name, one), (rival, two) in itertools.combinations(boxes.items(), 2):
        beside = one["x"] + one["width"] <= two["x"] + 0.5 or two["x"] + two["width"] <= one["x"] + 0.5
        above = one["y"] + one["height"] <= two["y"] + 0.5 or two["y"] + two["height"] <= one["y"] + 0.5
        assert beside or above, (name, rival)


def test_two_people_share_a_touch_screen(browser, address):
    with opened(browser, f"{address}?pursuer=you&evader=you", **PHONE) as page:
        page.click("#go")
        fingers = []
        for side, share in (("pursuer", 0.5), ("evader", 0.9)):
            box = page.locator(f"#pad-{side}").bounding_box()
            fingers.append({"x": box["x"] + share * box["width"], "y": box["y"] + 0.1 * box["height"]})
        screen = page.context.new_cdp_session(page)
        screen.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": fingers})
        wait_for_seconds(page, 1)
        last = page.evaluate("apollonius.page.match.actions.at(-1)")
        screen.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        assert last == [7, 6]


def test_a_hidden_tab_pauses_and_a_controller_steers(browser, address):
    with opened(browser, f"{address}?level=1") as page:
        page.evaluate(
            """() => {
              globalThis.button = { pressed: false };
              const buttons = Array.from({ length: 16 }, (_, index) => (index === 0 ? button : { pressed: false }));
              navigator.getGamepads = () => [null, { connected: true, axes: [-1, -0.9], buttons }];
              button.pressed = true;
            }"""
        )
        wait_for_seconds(page, 0.5)
        assert page.evaluate("apollonius.page.match.actions.at(-1)[1]") == 8
        page.evaluate(
            """() => {
              Object.defineProperty(document, "hidden", { value: true });
              document.dispatchEvent(new Event("visibilitychange"));
            }"""
        )
        assert page.get_attribute("body", "data-phase") == "paused"


def test_agents_are_a_show_at_any_speed(browser, address):
    with opened(browser, f"{address}?pursuer=still&evader=still") as page:
        page.select_option("#speed", "10")
        page.keyboard.press("Space")
        wait_for_seconds(page, 8)
        assert page.evaluate("apollonius.timing.interval.durations.reduce((sum, one) => sum + one)") < 4000
        assert page.inner_text("#pursuer-name") == "stands still (still)"


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
        page.click("#menu")
        page.select_option("#game", game)
        page.click("#play")
        page.wait_for_selector("#go:enabled")
        page.click("#go")
        wait_for_seconds(page, 1)
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
    page.click("#menu")
    page.select_option("#pursuer", "random")
    page.click("#play")
    page.wait_for_selector("#go:enabled")
    context.close()
