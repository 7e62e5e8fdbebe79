"""The page in a real browser: a person plays a game to its end, and its replay plays again in Python."""

import itertools
import json
import re

import pytest

from apollonius.play.replay import load_replay
from tests.web.browser import needs_chromium, playwright

pytestmark = needs_chromium
PIXEL = """share => {
  const canvas = document.getElementById("canvas");
  return [...canvas.getContext("2d").getImageData(0.3 * canvas.width, share * canvas.height, 1, 1).data];
}"""


def test_a_person_plays_a_game_to_its_end(desk, tmp_path):
    page = desk.open()
    before = desk.match("state.evader[0]")
    page.keyboard.press("Space")
    desk.let_pass(1.5)
    page.keyboard.down("ArrowUp")
    desk.let_pass(1)
    assert desk.match("state.evader[0].v") > before["v"]
    page.keyboard.down("ArrowLeft")
    desk.let_pass(1)
    page.keyboard.up("ArrowLeft")
    assert desk.match("state.evader[0].heading") != before["heading"]
    desk.let_pass(20)
    ended, last = desk.match("seconds"), page.evaluate("apollonius.page.lostAt") / 10
    could = f"Until {last:.1f}\u00a0s you could have braked in time."
    said = f"You ran into a wall after {ended:.1f}\u00a0s. You lose. {could} Your longest so far."
    assert page.inner_text("#message") == said
    assert ended - 3 < last < ended
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


def test_pause_restart_and_new_start(desk):
    page = desk.open()
    first = desk.match("state.evader[0]")
    page.keyboard.press("Space")
    desk.let_pass(0.25)
    assert page.inner_text("#message") == "3"
    desk.let_pass(2)
    page.keyboard.press("Space")
    assert page.inner_text("#message") == "Paused"
    stopped = desk.match("seconds")
    assert stopped > 0
    desk.let_pass(1)
    assert desk.match("seconds") == stopped
    page.click("#again")
    desk.let_pass(0.25)
    assert page.inner_text("#clock") == "100.0"
    assert desk.match("state.evader[0]") == first
    page.click("#next")
    assert desk.match("state.evader[0]") != first


def test_choices_change_the_game_and_the_address(desk):
    page = desk.open()
    page.click("#menu")
    page.select_option("#game", "one-large")
    page.select_option("#evader", "E_scratch")
    page.select_option("#pursuer", "P_pool")
    page.uncheck("#shield")
    page.fill("#seed", "7")
    page.press("#seed", "Enter")
    page.wait_for_selector("#go:enabled")
    page.keyboard.press("Space")
    desk.let_pass(1.5)
    assert desk.match("game.arena.discs.length") == 1
    assert page.evaluate("apollonius.timing.move.durations.length") >= 20
    start = desk.match("start")
    query = "?pursuer=P_pool&evader=E_scratch&game=one-large&difficulty=sharp&seed=7"
    assert page.url.endswith(query)
    desk.open(query)
    assert desk.match("start") == start


@pytest.mark.parametrize(
    ("query", "unknown"),
    [
        ("?level=99", 'level "99"'),
        ("?pursuer=nobody", 'pursuer "nobody"'),
        ("?evader=encirclement", 'evader "encirclement"'),
        ("?game=nope", 'game "nope"'),
        ("?game=team-17v1", 'game "team-17v1"'),
        ("?difficulty=none", 'difficulty "none"'),
        ("?seed=-1", 'seed "-1"'),
    ],
)
def test_what_an_address_asks_for_in_vain_is_said(desk, query, unknown):
    page = desk.open(query)
    assert page.inner_text("#message") == f"There is no {unknown}: Start plays another game, or choose under Games."
    assert page.get_attribute("body", "data-phase") == "ready"


def test_a_finger_on_the_pad_steers(phone):
    page = phone.open()
    assert page.evaluate("document.documentElement.scrollWidth") <= 375
    before = phone.match("state.evader[0]")
    page.click("#go")
    phone.let_pass(1.5)
    box = page.locator("#pad-evader").bounding_box()
    page.mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 0.1 * box["height"])
    page.mouse.down()
    phone.let_pass(1)
    page.mouse.up()
    after = phone.match("state.evader[0]")
    assert after["v"] > before["v"]
    turned = (after["heading"] - before["heading"] + 3.14159) % 6.28318 - 3.14159
    assert -2 < turned < -0.4


def test_two_people_have_keys_of_their_own(desk):
    page = desk.open("?pursuer=you&evader=you")
    page.keyboard.press("Space")
    page.keyboard.down("KeyW")
    desk.let_pass(2.5)
    page.keyboard.up("KeyW")
    assert desk.match("state.pursuer[0].v") > 0.1
    assert desk.match("state.evader[0].v") == 0


def test_a_person_who_lasts_has_won(desk):
    page = desk.open("?level=1")
    assert page.inner_text("#goal") == "1. You are blue: survive 20\u00a0s"
    desk.end_after(3)
    assert page.inner_text("#message") == "You survived after 0.3\u00a0s. You win! Your best so far."
    assert page.inner_text("#evader-score") == "1"
    page.click("#menu")
    assert "won, 0.3 s" in page.inner_text("#levels li:first-child")
    page.keyboard.press("Escape")
    page.keyboard.press("Space")
    playwright.expect(page.locator("#goal")).to_have_text(re.compile("^2. You are blue: survive 40"), timeout=30_000)
    assert page.url.endswith("?level=2")


def test_keys_are_the_games_at_once_when_the_list_closes(desk):
    page = desk.open()
    page.click("#menu")
    phase = page.evaluate(
        """() => {
          document.getElementById("games").close();
          document.activeElement.dispatchEvent(new KeyboardEvent("keydown", { code: "Space", bubbles: true }));
          return apollonius.page.phase;
        }"""
    )
    assert phase == "counting"


def test_a_capture_is_shown_from_the_moment_it_was_lost(desk):
    page = desk.open("?pursuer=shielded:P_any&evader=you&seed=4")
    page.click("#go")
    while page.get_attribute("body", "data-phase") != "over":
        desk.let_pass(2)
    ended = desk.match("seconds")
    while page.evaluate("apollonius.page.lostAt") is None:
        page.wait_for_timeout(100)
        desk.let_pass(0.25)
    lost_at = page.evaluate("apollonius.page.lostAt")
    assert 0 < lost_at < 10 * ended
    assert f"You lose. Until {lost_at / 10:.1f}\u00a0s the agent E_any would have got away." in page.inner_text(
        "#message"
    )
    begun = float(page.inner_text("#when").removesuffix("\u00a0s"))
    assert lost_at / 10 <= begun < ended
    assert page.is_visible("#mark")
    desk.let_pass(2)
    assert float(page.inner_text("#when").removesuffix("\u00a0s")) > begun
    page.focus("#moment")
    page.keyboard.press("Home")
    desk.let_pass(1)
    assert page.inner_text("#when") == "0.0\u00a0s"
    assert page.inner_text("#clock") == "100.0"
    assert page.evaluate("apollonius.page.seen.match.states.length") == 1
    page.click("#again")
    assert page.get_attribute("body", "data-phase") == "ready"
    assert page.is_hidden("#moment")


@pytest.mark.parametrize("people", [1, 2])
def test_a_game_is_on_one_phone_screen(phone, people):
    page = phone.open(f"?pursuer={'you' if people == 2 else 'still'}&evader=you")
    pads = ["#pad-pursuer", "#pad-evader"][2 - people :]
    sizes = [(375, 667), (667, 375)]
    for size in sizes:
        within(page, size, ["#clock", "#message", "#go", "#again", "#next", "#why", "#menu", "#draw", *pads])
    phone.end_after(3)
    for size in sizes[::-1]:
        within(page, size, ["#clock", "#message", "#go", "#download", "#replay", "#moment"])


def within(page, size, names):
    """On a screen of this size, parts of the page are wholly on it, beside the arena and beside each other."""
    page.set_viewport_size({"width": size[0], "height": size[1]})
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


def test_two_people_share_a_touch_screen(phone):
    page = phone.open("?pursuer=you&evader=you")
    page.click("#go")
    fingers = []
    for side, share in (("pursuer", 0.5), ("evader", 0.9)):
        box = page.locator(f"#pad-{side}").bounding_box()
        fingers.append({"x": box["x"] + share * box["width"], "y": box["y"] + 0.1 * box["height"]})
    screen = page.context.new_cdp_session(page)
    screen.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": fingers})
    phone.let_pass(2)
    last = phone.match("actions.at(-1)")
    screen.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    assert last == [7, 6]


def test_a_hidden_tab_pauses_and_a_controller_steers(desk):
    page = desk.open("?level=1")
    page.evaluate(
        """() => {
          globalThis.button = { pressed: false };
          const buttons = Array.from({ length: 16 }, (_, index) => (index === 0 ? button : { pressed: false }));
          navigator.getGamepads = () => [null, { connected: true, axes: [-1, -0.9], buttons }];
          button.pressed = true;
        }"""
    )
    desk.let_pass(2.5)
    assert desk.match("actions.at(-1)[1]") == 8
    page.evaluate(
        """() => {
          Object.defineProperty(document, "hidden", { value: true });
          document.dispatchEvent(new Event("visibilitychange"));
        }"""
    )
    assert page.get_attribute("body", "data-phase") == "paused"


def test_agents_are_a_show_at_any_speed(desk):
    page = desk.open("?pursuer=still&evader=still")
    page.select_option("#speed", "10")
    page.keyboard.press("Space")
    desk.let_pass(1.5)
    assert 8 < desk.match("seconds") < 15
    assert page.inner_text("#pursuer-name") == "stands still (still)"


@pytest.mark.parametrize("game", ["hall", "maze"])
def test_an_agent_that_knows_no_arena_plays_in_any(desk, game, tmp_path):
    page = desk.open(f"?pursuer=small&evader=still&game={game}")
    page.click("#go")
    desk.let_pass(1.5)
    assert page.evaluate("apollonius.timing.move.durations.length") >= 10
    block, aisle = (page.evaluate(PIXEL, share) for share in (0.6, 0.2))
    replay = page.evaluate(
        "() => { const { match } = apollonius.page; while (!match.isOver) match.step(); return match.replay(); }"
    )
    assert replay["pursuer"] == "small"
    if game == "hall":
        assert block != aisle
        assert set(replay["game"]["arena"]["map"]) == {"file", "sha256"}
    else:
        (tmp_path / "game.json").write_text(json.dumps(replay))
        assert load_replay(tmp_path / "game.json").first_difference() is None


def test_why_shows_what_comes(desk):
    """What agents are expected to do is what they then do; what they think best is what they do."""
    page = desk.open("?pursuer=P_any&evader=E_any&game=office&seed=3")
    page.keyboard.press("KeyV")
    assert page.get_attribute("#why", "aria-pressed") == "true"
    page.click("#go")
    desk.let_pass(1)
    now, known = page.evaluate(
        """() => {
          const { insight, match } = apollonius.page;
          const { course, leads, robots } = insight.of(["values", "brakes", "regions", "course"]);
          return [match.states.length, { course, robots, leads: [...leads].map((lead) => lead ?? null) }];
        }"""
    )
    desk.let_pass(2.5)
    first = known["course"][0]["steps"]
    assert first < now
    assert len(known["course"]) == 21
    assert known["course"] == desk.match(f"states.slice({first}, {first + 21})")
    taken = desk.match(f"actions[{now - 1}]")
    assert [robot["values"].index(max(robot["values"])) for robot in known["robots"]] == taken
    assert all(robot["stops"][1] for robot in known["robots"]), "at rest or nearly so, they can brake"
    leads = [lead for lead in known["leads"] if lead is not None and lead == lead]
    assert min(leads) < 0 < max(leads)


def test_an_agent_that_cannot_be_loaded_is_said(desk):
    page = desk.open("?pursuer=still")
    page.route("**/agents/*", lambda route: route.fulfill(status=404))
    page.click("#menu")
    page.select_option("#pursuer", "P_pool")
    page.click("#play")
    playwright.expect(page.locator("#message")).to_have_text(re.compile("P_pool cannot be loaded"))
    assert page.is_disabled("#go")
    page.unroute("**/agents/*")
    page.click("#menu")
    page.select_option("#pursuer", "random")
    page.click("#play")
    page.wait_for_selector("#go:enabled")
    (complaint,) = desk.complaints
    assert "404" in complaint
    desk.complaints.clear()


LEGIBLE = """() => {
  const numbers = (colour) => colour.match(/[\\d.]+/g).map(Number);
  const luminance = (colour) => {
    const parts = numbers(colour).slice(0, 3).map((part) => part / 255);
    const linear = parts.map((part) => (part <= 0.03928 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
  };
  const isOpaque = (colour) => (numbers(colour)[3] ?? 1) === 1;
  const ground = (element) => {
    const { backgroundColor } = getComputedStyle(element);
    return isOpaque(backgroundColor) || !element.parentElement ? backgroundColor : ground(element.parentElement);
  };
  const isShown = (element) => element.checkVisibility({ opacityProperty: true, visibilityProperty: true });
  const hasWords = ({ childNodes }) => [...childNodes].some(({ nodeType, data }) => nodeType === 3 && data.trim());
  return [...document.querySelectorAll("body *")]
    .filter((element) => isShown(element) && hasWords(element) && !element.disabled)
    .map((element) => {
      const [less, more] = [getComputedStyle(element).color, ground(element)].map(luminance).sort((a, b) => a - b);
      return [element.textContent.trim(), (more + 0.05) / (less + 0.05)];
    });
}"""
"""The words that are shown, and their contrast by WCAG 2.2."""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_all_words_have_contrast_and_all_that_can_be_used_has_a_name(desk, scheme):
    page = desk.open("?pursuer=P_pool&evader=you")
    page.emulate_media(color_scheme=scheme)
    for opening, closing in ((None, None), ("#menu", "#play"), ("#draw", "#back")):
        if opening:
            page.click(opening)
            desk.let_pass(0.5)
        words = page.evaluate(LEGIBLE)
        assert len(words) > 8
        assert [(text, contrast) for text, contrast in words if contrast < 4.5] == []
        for role in ("button", "combobox", "slider", "spinbutton", "checkbox"):
            used, named = page.get_by_role(role), page.get_by_role(role, name=re.compile(r"\S"))
            for _ in range(20):  # between two counts a panel may open
                if (count := used.count()) == named.count():
                    break
                page.wait_for_timeout(100)
            assert count == named.count(), role
        if closing:
            page.click(closing)
            page.wait_for_selector("#go:enabled")
    page.emulate_media(color_scheme="light")
