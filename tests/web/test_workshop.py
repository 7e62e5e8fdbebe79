"""Arenas drawn in a real browser: by pointers and fingers, saved, loaded, shared, dropped, and played in."""

import base64
import itertools
import json
import zlib

import numpy as np
import pytest

from apollonius.arenas.file import load_game, to_dict
from apollonius.play.replay import load_replay
from tests.web.browser import needs_chromium, playwright

pytestmark = needs_chromium
PLACING = """async arena => {
  const canvas = document.getElementById("canvas");
  const { placing } = await import("./draw.js");
  const { left, top } = canvas.getBoundingClientRect();
  return { ...placing(canvas, arena), left, top, ratio: devicePixelRatio };
}"""
"""Where an arena of these limits [m] lies, in pixels of the canvas, and where that lies in the window [px]."""
PIXEL = """share => {
  const canvas = document.getElementById("canvas");
  return [...canvas.getContext("2d").getImageData(0.3 * canvas.width, share * canvas.height, 1, 1).data];
}"""
DROP = """([name, text]) => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([text], name));
  document.body.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
}"""
"""Drop a file of a name and a text."""


class Hand:
    """A person's hand on the arena of a tab, which is ten metres wide and high."""

    def __init__(self, tab):
        self.tab, self.page = tab, tab.page
        self.page.click("#draw")
        self.page.click("#clear")
        tab.let_pass(0.25)
        walls = {"x_min": 0, "x_max": 10, "y_min": 0, "y_max": 10}
        self.placing = self.page.evaluate(PLACING, walls)

    def at(self, x, y):
        """The place [px] of a place in the arena [m]."""
        where = self.placing
        right, down = where["x"] + where["scale"] * x, where["y"] - where["scale"] * y
        return where["left"] + right / where["ratio"], where["top"] + down / where["ratio"]

    def use(self, tool, start, end=None):
        self.page.click(f"#tools [value={tool}]")
        self.page.mouse.move(*self.at(*start))
        self.page.mouse.down()
        if end:
            self.page.mouse.move(*self.at(*end), steps=3)
        self.page.mouse.up()

    def save(self, path):
        return load_game(self.tab.save(path, "#save"))


def corners(polygon):
    return [[round(float(length), 2) for length in corner] for corner in polygon.vertices]


def test_arena_is_drawn_shared_and_played_to_its_end(desk, tmp_path):
    page = desk.open("?pursuer=pursuer&evader=you")
    hand = Hand(desk)
    hand.use("disc", (2, 8), (2.6, 8))
    hand.use("block", (6, 6), (7, 8))
    hand.use("wall", (1, 3), (3.4, 3))
    hand.use("wall", (4.6, 3), (7, 3))
    hand.use("block", (8, 1))
    page.click("#undo")
    hand.use("select", (6.5, 7), (7.5, 7))
    hand.use("select", (8, 8), (8.5, 9))
    game = hand.save(tmp_path / "arena.json")
    (disc,) = game.arena.discs
    np.testing.assert_allclose([disc.x, disc.y, disc.radius], [2, 8, 0.6], atol=0.051)
    block, *walls = map(corners, game.arena.polygons)
    assert block == [[7, 6], [8.5, 6], [8.5, 9], [7, 9]]
    assert [wall[0][0] for wall in walls] == [1, 4.6]
    page.click("#share")
    playwright.expect(page.locator("#said")).to_contain_text("is copied")
    link = page.evaluate("location.hash")
    page.click("#clear")
    page.evaluate(DROP, ["arena.json", (tmp_path / "arena.json").read_text()])
    again = hand.save(tmp_path / "again.json")
    assert to_dict(again) == to_dict(game)
    page = desk.open(link)
    assert desk.match("players.pursuer[0].name") == "shielded:pursuer"
    assert desk.match("game") == json.loads(json.dumps(to_dict(game)))
    desk.play(2)
    desk.finish()
    assert page.inner_text("#message").startswith("Red caught you")
    replay = load_replay(desk.save(tmp_path / "game.json"))
    assert replay.pursuer == "shielded:pursuer"
    assert replay.first_difference() is None


def test_defects_are_reported_while_an_arena_is_drawn(desk, tmp_path):
    page = desk.open()
    hand = Hand(desk)
    hand.use("wall", (0, 5), (10, 5))
    playwright.expect(page.locator("#findings")).to_contain_text("free space falls into 2 parts")
    page.click("#remove")
    hand.use("wall", (0, 5), (8, 5))
    playwright.expect(page.locator("#findings")).to_have_text("✓ Nothing is wrong with this arena.")
    (tmp_path / "hall.toml").write_text("[arena]\nx_max = 12.0\n")
    page.set_input_files("#file", tmp_path / "hall.toml")
    said = "this page reads JSON, which apollonius arena check hall.toml --out hall.json writes."
    playwright.expect(page.locator("#said")).to_have_text(said)
    page.click("#back")
    assert page.get_attribute("body", "data-phase") == "ready"


def test_arena_on_a_map_is_edited_and_played(desk):
    page = desk.open("?pursuer=pursuer&evader=still&game=hall")
    page.click("#draw")
    page.click("#tools [value=disc]")
    page.focus("#tools [value=disc]")
    page.keyboard.press("Enter")
    page.click("#play-here")
    page.wait_for_selector("#go:enabled")
    desk.play(1)
    assert desk.match("actions.length") >= 9
    record = desk.match("replay().game.arena")
    assert len(record["discs"]) == 1
    assert set(record["map"]) == {"file", "sha256"}
    assert record["map"]["file"].endswith("floor.yaml")
    block, aisle = (page.evaluate(PIXEL, share) for share in (0.59, 0.4))
    assert block != aisle
    assert desk.match("game.arena.map.field.length") == 81 * 121


def test_arenas_can_be_drawn_by_touch_on_a_phone(phone, tmp_path):
    page = phone.open()
    page.set_viewport_size({"width": 375, "height": 667})
    hand = Hand(phone)
    assert page.evaluate("document.documentElement.scrollWidth") <= 375
    screen = page.context.new_cdp_session(page)
    for tool, ways in (("wall", [(2, 4), (5, 4), (8, 4)]), ("disc", [(5, 8)])):
        page.click(f"#tools [value={tool}]")
        page.wait_for_selector(f"#tools [value={tool}][aria-pressed=true]")
        for kind, (x, y) in zip(["touchStart", *["touchMove"] * 2], ways, strict=False):
            right, down = hand.at(x, y)
            screen.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": right, "y": down}]})
        screen.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    game = hand.save(tmp_path / "arena.json")
    (wall,) = map(corners, game.arena.polygons)
    assert wall == [[2, 3.9], [8, 3.9], [8, 4.1], [2, 4.1]]
    assert [disc.radius for disc in game.arena.discs] == pytest.approx([0.5])
    edges = page.evaluate(
        """() => {
          document.getElementById("findings").textContent = "The free space falls into two parts. ".repeat(36);
          const parts = [...document.querySelector(".sheet").children].filter((part) => part.checkVisibility());
          const top = (part) => part.getBoundingClientRect().top;
          return parts.map((part) => [part.id, top(part) + part.scrollHeight, top(part)]);
        }"""
    )
    assert len(edges) == 9
    assert all(bottom <= top + 1 for (_, bottom, _), (_, _, top) in itertools.pairwise(edges)), "findings push down"


def test_hostile_link_is_refused_and_runs_no_code(desk):
    for hostile in ('"<svg onload=hacked=1>": 1', '"map": "//evil.example/<script>hacked=1</script>"'):
        packed = zlib.compress(f'{{"arena": {{{hostile}}}}}'.encode(), wbits=-zlib.MAX_WBITS)
        page = desk.open(f"#game={base64.urlsafe_b64encode(packed).decode().rstrip('=')}")
        assert page.inner_text("#message").startswith("The arena in this link cannot be played: ")
        assert page.evaluate("globalThis.hacked === undefined && ({}).hacked === undefined")
        assert page.locator("#message *").count() == 0
