"""Teams on the page, in a real browser: a person leads one of three pursuers, or flees from three."""

import re

from apollonius.play.replay import load_replay
from tests.web.browser import needs_chromium, playwright
from tests.web.test_page import within

pytestmark = needs_chromium


def saved(page, path):
    """The replay that the page saves."""
    with page.expect_download() as download:
        page.click("#download")
    download.value.save_as(path)
    return load_replay(path)


def test_a_person_leads_a_team_to_its_end(desk, tmp_path):
    page = desk.open("?pursuer=you&evader=shielded:E_any&game=team-3v1&seed=2")
    assert page.inner_text("#goal") == "You are red 1 of 3: catch blue within 100\u00a0s"
    page.keyboard.press("Space")
    page.keyboard.down("ArrowUp")
    for _ in range(40):
        desk.let_pass(0.5)
        if page.inner_text("#message").endswith("Your team plays on."):
            break
    lost = desk.match("seconds")
    assert re.fullmatch(r"You ran into a wall after [\d.]+\u00a0s\. Your team plays on\.", page.inner_text("#message"))
    page.keyboard.press("Space")
    page.keyboard.press("Space")
    desk.let_pass(1.75)
    assert page.inner_text("#message").endswith("Your team plays on."), "also after a pause"
    desk.let_pass(30)
    said = page.inner_text("#message")
    ends = r"You ran into a wall after [\d.]+\u00a0s, but your team caught it after [\d.]+\u00a0s\. You win!"
    assert re.match(ends, said)
    assert desk.match("seconds") > lost
    replay = saved(page, tmp_path / "game.json")
    assert (replay.pursuer, replay.outcome.name) == ("you+shielded:P_team", "CAPTURED")
    assert replay.actions.shape[1] == 4
    assert set(replay.actions[:20, 0]) == {7}
    assert replay.first_difference() is None


def test_a_finger_flees_from_three(phone, tmp_path):
    page = phone.open("?pursuer=P_team&evader=you&game=team-3v1/blocks&difficulty=gentle")
    assert page.inner_text("#goal") == "You are blue: survive 3 reds for 100\u00a0s"
    within(page, (375, 667), ["#goal", "#clock", "#message", "#go", "#again", "#next", "#why", "#menu", "#pad-evader"])
    page.click("#go")
    box = page.locator("#pad-evader").bounding_box()
    finger = {"x": box["x"] + 0.9 * box["width"], "y": box["y"] + 0.1 * box["height"]}
    screen = page.context.new_cdp_session(page)
    screen.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [finger]})
    phone.let_pass(30)
    screen.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    playwright.expect(page.locator("#go")).to_have_text("Try again")
    assert page.inner_text("#message").startswith("You ")
    replay = saved(page, tmp_path / "game.json")
    assert set(replay.actions[15:, 3]) == {6}
    assert len({tuple(row) for row in replay.actions[:, :3]}) > 5, "the three act for themselves"
    assert replay.first_difference() is None


def test_numbers_of_robots_are_chosen_in_the_menu(desk):
    page = desk.open("?pursuer=you&evader=flee-aware&game=office")
    page.click("#menu")
    options = "[...document.querySelectorAll('#pursuer option')].map((option) => option.value)"
    assert "encirclement" not in page.evaluate(options)
    page.select_option("#robots", "3 v 2")
    assert "encirclement" in page.evaluate(options)
    page.select_option("#pursuer", "you+encirclement")
    page.click("#play")
    page.wait_for_selector("#go:enabled")
    assert "pursuer=you%2Bencirclement" in page.url
    assert "game=team-3v2%2Foffice" in page.url
    assert desk.match("players.pursuer.map(({ name }) => name)") == ["you", "encirclement", "encirclement"]
    assert page.inner_text("#goal") == "You are red 1 of 3: catch both blues within 100\u00a0s"
    page.click("#menu")
    page.select_option("#robots", "1 v 1")
    assert page.input_value("#pursuer") == "you"
    page.click("#play")
    page.wait_for_selector("#go:enabled")
    assert desk.match("state.pursuer.length") == 1


def test_a_drawn_arena_is_played_by_teams(desk):
    page = desk.open("?pursuer=you&evader=still&game=team-2v1/one-large")
    page.click("#draw")
    page.click("#clear")
    page.click("#play-here")
    page.wait_for_selector("#go:enabled")
    assert desk.match("game.arena.discs.length") == 0
    assert desk.match("state.pursuer.length") == 2
    assert "game=team-2v1%2Fdrawn" in page.url


def test_a_level_is_played_by_a_team(desk):
    page = desk.open("?level=11")
    assert page.inner_text("#goal") == "11. You are red 1 of 3: catch blue within 60\u00a0s"
    names = ["you", "shielded:pure-pursuit", "shielded:pure-pursuit"]
    assert desk.match("players.pursuer.map(({ name }) => name)") == names
    assert desk.match("players.evader[0].name") == "shielded:E_any (fair)"


def test_layers_show_every_robot_in_play(desk):
    page = desk.open("?pursuer=P_team&evader=E_any&game=team-2v1&seed=3")
    page.click("#go")
    desk.let_pass(1.5)
    known = page.evaluate(
        """() => {
          const { insight, match } = apollonius.page;
          match.state.pursuer[0].status = "hit_obstacle";
          const { course, robots } = insight.of(["values", "brakes", "course"]);
          return { robots: robots.map(({ role, number }) => [role, number]), course: course.length };
        }"""
    )
    assert known["robots"] == [["pursuer", 1], ["evader", 0]]
