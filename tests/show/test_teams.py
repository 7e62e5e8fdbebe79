"""Games of teams in pictures: a trail for each robot, its number, a sign for who is out, and who is left in words."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from PIL import ImageColor, ImageDraw

from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.presets import in_teams
from apollonius.game.types import GameState, Outcome, RobotState
from apollonius.play.replay import Replay, as_rows, load_replay, play_actions, save_replay
from apollonius.show.animation import LINE, MARGIN, frames
from apollonius.show.arena import draw_game, save_picture
from apollonius.show.canvas import SIZE
from apollonius.show.palette import EVADER, PAPER, PURSUER
from apollonius.show.parts import in_play
from apollonius.show.report.page import Page, Shown, save_page
from tests.show.test_replay_player import RECORDER, run
from tests.web.browser import launched, needs_chromium, playwright

OUT, CAUGHT = 3, 10
"""Steps at which the first pursuer leaves the walls and the second one's evader is caught."""


@pytest.fixture(scope="module")
def replay():
    """Two against two, all straight ahead: the first pursuer leaves the walls, the second catches the first evader."""
    places = [(9.75, 2, 1, 0), (2, 5, 1, 0)], [(3.15, 5.25, 0, 0), (5, 8, 1, np.pi / 2)]
    robots = BySide(*(tuple(RobotState(*map(jnp.float32, place)) for place in side) for side in places))
    game, actions = in_teams(Game(max_steps=12), 2, 2), jnp.full((12, 4), 4)
    states, outcomes = play_actions(game, GameState.at_start(robots), actions)
    end = Outcome(int(outcomes[-1]))
    return Replay(game, "P", "E", 0, 1, 0, as_rows(jax.device_get(states)), np.asarray(actions), end)


def test_who_is_in_play_is_known_for_each_state(replay):
    steps = in_play(replay.game, replay).sum(axis=0)
    assert steps.tolist() == [OUT, 13, CAUGHT, 13]
    shown = Shown(replay, 1).to_dict()
    assert shown["until"] == [OUT, None, CAUGHT, None]


def test_frames_have_all_robots_with_their_numbers_and_crosses_for_those_out(replay, monkeypatch):
    said, write = [], ImageDraw.ImageDraw.text

    def listen(self, place, text, *arguments, **options):
        said.append(text)
        write(self, place, text, *arguments, **options)

    monkeypatch.setattr(ImageDraw.ImageDraw, "text", listen)
    first, last = frames(replay, [0, 12])
    head = ["capture within 0.3 m", "1 m", "2 pursuers P", "2 evaders E"]
    assert said[:4] == head
    assert said[4:10] == ["1", "2", "1", "2", "0.0 s", "2 v 2 in play, distance 1.18 m"]
    apart = np.hypot(replay.states[-1, 12] - replay.states[-1, 4], replay.states[-1, 13] - replay.states[-1, 5])
    assert said[10:] == ["2", "2", "no result after 1.2 s", f"1 v 1 in play, distance {apart:.2f} m"]

    def colour(picture, x, y):
        return picture.getpixel((MARGIN + round(x / 10 * SIZE), MARGIN + 2 * LINE + round((10 - y) / 10 * SIZE)))

    beside = 0.09  # m; in a disc, and off the arms of a cross
    pursuer, evader, paper = map(ImageColor.getrgb, (PURSUER, EVADER, PAPER))
    assert [colour(first, 9.75 - beside, 2), colour(first, 2 - beside, 5)] == [pursuer, pursuer]
    x, y = replay.states[-1, 8:10]
    assert colour(last, x, y) == evader
    assert colour(last, x, y + beside) == paper
    x, y = replay.states[-1, 4:6]
    assert colour(last, x, y + beside) == pursuer


def test_a_picture_has_a_trail_for_each_robot_to_where_it_went_out(replay, tmp_path):
    axes = Figure().subplots()
    draw_game(axes, replay.game, replay.trajectory(), "a title")
    trails = [line for line in axes.lines if line.get_linestyle() in ("-", "--") and len(line.get_xdata()) > 1]
    for index, (trail, length) in enumerate(zip(trails, (OUT + 1, 13, CAUGHT + 1, 13), strict=True)):
        np.testing.assert_allclose(trail.get_xydata(), replay.states[:length, 4 * index : 4 * index + 2])
    squares = [line.get_xydata()[0] for line in axes.lines if line.get_marker() == "s" and len(line.get_xdata())]
    np.testing.assert_allclose(squares, [replay.states[OUT, :2], replay.states[CAUGHT, 8:10]])
    reaches = [patch.center for patch in axes.patches if isinstance(patch, Circle)]
    np.testing.assert_allclose(reaches, [replay.states[-1, 4:6]])
    assert sorted(text.get_text() for text in axes.texts) == ["1"] * 4 + ["2"] * 4
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["2 pursuers", "2 evaders", "start", "out of play"]
    save_replay(replay, tmp_path / "game.json")
    save_picture(load_replay(tmp_path / "game.json"), tmp_path / "game.png")
    assert (tmp_path / "game.png").stat().st_size > 10_000


def test_the_page_draws_every_robot_and_says_who_is_left(replay, tmp_path):
    script = (
        RECORDER
        + """
player.drawGame(canvas, game.game, states, 12, colours);
const marks = calls.filter(([name]) => name === "fillText").map((call) => call[1]);
const reaches = calls.filter(([name, , , radius]) => name === "arc" && radius === 0.3).length;
console.log(JSON.stringify([marks, reaches, player.facts(game.game, states[0]), player.facts(game.game, states[12])]));
"""
    )
    marks, reaches, first, last = run(tmp_path, script, Shown(replay, 1).to_dict())
    assert (marks, reaches) == (["1", "2", "1", "2"], 1)
    assert first == "distance 1.18 m · 2 v 2 in play"
    assert last.endswith("1 v 1 in play")


@needs_chromium
@pytest.mark.slow
def test_a_report_plays_teams_from_disk(replay, tmp_path):
    save_page(Page("Games", "One.", games=[Shown(replay, 1)]), tmp_path / "report.html")
    complaints = []
    with playwright.sync_playwright() as driver:
        browser = launched(driver)
        page = browser.new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto((tmp_path / "report.html").as_uri())
        assert page.inner_text("[data-part=facts]").endswith("1 v 1 in play")
        pixels = "document.querySelector('canvas').toDataURL()"
        bare = page.evaluate(pixels)
        for layer in ("brakes", "regions", "course"):
            page.check(f"input[name={layer}]")
        assert page.evaluate(pixels) != bare
        page.focus("[data-part=seek]")
        page.keyboard.press("Home")
        assert page.inner_text("[data-part=facts]").endswith("2 v 2 in play")
        page.click("[data-part=play]")
        playwright.expect(page.locator("[data-part=clock]")).to_have_text("1.2 s of 1.2 s")
        browser.close()
    assert complaints == []
