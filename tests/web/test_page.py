"""The page in a real browser: a person plays a game to its end, and its replay plays again in Python."""

import itertools
import re
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

import apollonius
from apollonius.catalogue import find_player
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.view import look
from apollonius.play.replay import as_state, load_replay
from apollonius.show.animation import fog
from apollonius.web import programs
from apollonius.web.programs import player_program, sources, sources_digest, write_player
from apollonius.web.site import DOORS, PAGE, SHUTTLES, WALKERS
from tests.documents import REPOSITORY
from tests.web.browser import needs_chromium, playwright

pytestmark = needs_chromium
SPIRAL = "dbde486c77e5e45dcd8c12998981056ec289b195f4c4f0d4c578d3d28eeb6842"
"""SHA-256 of the C sources of `spiral.wasm`, which `write_player` makes anew."""


def test_person_plays_a_game_to_its_end(desk, tmp_path):
    page = desk.open()
    before = desk.match("state.evader[0]")
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
    assert desk.match("state.evader[0]") == before
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
    page.keyboard.up("ArrowUp")
    place = page.locator("#message").bounding_box()
    hit = desk.match("state.evader[0].y")
    assert (place["y"] > 280) == (hit > 5), "the message is not where the crash was"
    ended, last = desk.match("seconds"), page.evaluate("apollonius.page.lostAt") / 10
    could = f"Until {last:.1f}\u00a0s you could have braked in time."
    assert page.inner_text("#message") == f"You ran into a wall after {ended:.1f}\u00a0s. You lose. {could}"
    assert ended - 3 < last < ended
    assert page.inner_text("#go") == "Try again"
    assert page.inner_text("#pursuer-score") == "1"
    replay = load_replay(desk.save(tmp_path / "game.json"))
    assert (replay.pursuer, replay.evader, replay.outcome.name) == ("shielded:pursuer", "you", "EVADER_OUT_OF_RANGE")
    assert {7, 8} <= set(replay.actions[:, 1].tolist())
    assert replay.first_difference() is None
    page.click("#go")
    assert desk.match("state.evader[0]") == before, "it can be tried again"
    page.click("#next")
    assert desk.match("state.evader[0]") != before


def test_choices_change_the_game_and_the_address(desk):
    page = desk.open()
    page.click("#menu")
    page.select_option("#game", "office")
    options = "[...document.querySelectorAll('#pursuer option')].map((option) => option.value)"
    assert "encirclement" not in page.evaluate(options)
    page.select_option("#robots", "3 v 2")
    assert "encirclement" in page.evaluate(options)
    page.select_option("#pursuer", "you")
    page.select_option("#evader", "flee-aware")
    page.uncheck("#shield")
    page.fill("#seed", "7")
    page.press("#seed", "Enter")
    page.wait_for_selector("#go:enabled")
    query = "?pursuer=you&evader=flee-aware&game=team-3v2%2Foffice&difficulty=sharp&seed=7"
    assert page.url.endswith(query)
    assert desk.match("players.pursuer.map(({ name }) => name)") == ["you", "shielded:pursuer", "shielded:pursuer"]
    assert page.inner_text("#goal") == "You are red 1 of 3: catch both blues within 100\u00a0s"
    start = desk.match("start")
    page.click("#draw")
    page.click("#clear")
    page.click("#play-here")
    page.wait_for_selector("#go:enabled")
    assert desk.match("game.arena.polygons.length") == 0
    assert "game=team-3v2%2Fdrawn" in page.url
    desk.open(query)
    assert desk.match("start") == start


def test_unknown_address_parameters_are_reported(desk):
    for wrong in ("level=99", "evader=encirclement", "game=team-17v1", "difficulty=none", "seed=-1", "game=nope"):
        page, (name, value) = desk.open(f"?{wrong}"), wrong.split("=")
        assert page.inner_text("#message").startswith(f'There is no {name} "{value}": Start plays another game')
        assert page.get_attribute("body", "data-phase") == "ready"


def test_person_who_survives_wins_the_level(desk):
    page = desk.open("?level=1")
    assert page.inner_text("#goal") == "1. You are blue: survive 20\u00a0s"
    page.keyboard.press("Space")
    page.keyboard.down("ArrowUp")
    desk.let_pass(12)
    page.keyboard.up("ArrowUp")
    assert desk.match("outcome") in ("ongoing", "captured"), "here a shield brakes before the wall"
    page.click("#again")
    desk.end_after(3)
    assert page.inner_text("#message") == "You survived for 0.3\u00a0s. You win! New under Games: this level, endless."
    assert page.inner_text("#evader-score") == "1"
    colours = "[getComputedStyle(document.getElementById('message')).backgroundColor, document.body.dataset.result]"
    assert page.evaluate(colours) == ["rgb(43, 108, 163)", "won"], "the colour of who has won"
    page.click("#menu")
    assert page.inner_text("#games-title") == "Levels: 1 of 22 won"
    assert page.inner_text("#levels li:first-child").endswith("won\nEndless")
    phase = page.evaluate(
        """() => {
          document.getElementById("games").close();
          document.activeElement.dispatchEvent(new KeyboardEvent("keydown", { code: "Space", bubbles: true }));
          return apollonius.page.phase;
        }"""
    )
    assert phase == "loading", "keys are the game's at once when the list closes"
    playwright.expect(page.locator("#goal")).to_have_text(re.compile("^2. You are blue: survive 40"), timeout=30_000)
    assert page.url.endswith("?level=2")


def test_scenario_is_lost_and_won_and_its_line_shown(desk):
    page = desk.open("?level=22")
    start = desk.match("start")
    begins = "Pillar\nKeep the pillar between the two robots. It plays at half speed.\nSpace to begin"
    assert page.inner_text("#message").startswith(begins)
    assert page.is_hidden("#next")
    assert desk.match("game.evader.radius") == 0, "its line is proved for the rules as they are"
    desk.let_pass(6)
    assert page.evaluate("apollonius.page.attract") is None, "a person sees how it begins"
    desk.play(1)
    assert 0.3 < desk.match("seconds") < 0.6
    assert page.is_hidden("#line")
    desk.let_pass(4)
    assert page.inner_text("#message").startswith("Red caught you after")
    page.click("#line")
    assert page.inner_text("#goal") == "22. A line that wins. Then it is your turn"
    assert page.inner_text("#evader-name") == "the proved line"
    desk.let_pass(8)
    assert page.inner_text("#go") == "Your turn"
    page.click("#go")
    playwright.expect(page.locator("#goal")).to_have_text("22. You are blue: survive 3\u00a0s")
    page.wait_for_selector("#go:enabled")
    assert page.url.endswith("?level=22")
    assert desk.match("start") == start
    page.keyboard.down("ArrowUp")
    desk.play(1.25)
    page.keyboard.down("ArrowLeft")
    desk.let_pass(7)
    for key in ("ArrowUp", "ArrowLeft"):
        page.keyboard.up(key)
    assert page.inner_text("#message") == "You survived for 3.0\u00a0s. You win! Your best so far."
    assert page.inner_text("#go") == "Next level"
    page.keyboard.press("KeyN")
    desk.let_pass(0.25)
    assert desk.match("start") == start
    page.click("#menu")
    assert page.inner_text("#levels li:nth-child(22)").endswith("won")
    page.keyboard.press("Escape")


def test_endless_level_counts_how_long_a_person_survives(desk):
    page = desk.open("?level=1&endless=1")
    assert page.inner_text("#goal") == "1. You are blue: survive as long as you can"
    for steps, best in ((5, " Your best so far."), (3, ""), (6, " Your best so far.")):
        desk.end_after(steps)
        assert page.inner_text("#clock") == f"0.{steps}"
        assert page.inner_text("#message") == f"You survived for 0.{steps}\u00a0s. You win!{best}"
        page.click("#again")
    said = page.evaluate(
        """async () => {
          const { describeEnd } = await import("./words.js");
          const lost = { winner: "pursuer", outcome: "captured", seconds: 9 };
          return describeEnd({ ...apollonius.page.match, ...lost }, "evader", true);
        }"""
    )
    assert said == "Red caught you after 9.0\u00a0s."
    assert page.url.endswith("?level=1&endless=1")


def test_fog_hides_the_opponent_and_matches_the_package(desk, tmp_path):
    page = desk.open("?level=11")
    assert page.inner_text("#goal") == "11. You are blue (walls hide you both): survive 60\u00a0s"
    assert page.inner_text("#message").endswith("Hatched is where the other may be.")
    drawn = """async (number) => {
      const { fogOf } = await import("./fog.js");
      const match = apollonius.page.match.from(number);
      const fog = fogOf({ ...match, isOver: false }, "evader");
      return [fog.isHidden, [...fog.budget].flatMap((budget, cell) => (budget < 0 ? [] : [cell]))];
    }"""
    red = """() => {
      const { width, height } = document.getElementById("canvas");
      const { data } = document.getElementById("canvas").getContext("2d").getImageData(0, 0, width, height);
      return data.some((_, at) => at % 4 === 0 && data[at] > 150 && data[at + 1] < 100 && data[at + 2] < 100);
    }"""
    desk.play(0.5)
    is_hidden, shaded = page.evaluate(drawn, desk.match("states.length") - 1)
    assert is_hidden
    assert shaded
    assert not page.evaluate(red)
    page.evaluate("apollonius.page.match.game.max_steps = 12")
    desk.let_pass(4)
    assert desk.match("outcome") == "no_result"
    assert page.evaluate(red), "a game that is over is shown as it was"
    replay = load_replay(desk.save(tmp_path / "game.json"))
    swapped = replace(replay, game=replace(replay.game, sensors=replace(replay.game.sensors, pursuer=None)))
    _, cells = fog(swapped)
    for number in range(1, len(cells)):
        _, shaded = page.evaluate(drawn, number)
        assert len(set(shaded) ^ set(np.flatnonzero(cells[number]))) <= 2
    page.click("#draw")
    playwright.expect(page.locator("#findings")).to_have_text("✓ Nothing is wrong with this arena.")


def test_shared_game_is_played_again(desk, tmp_path):
    page = desk.open("?pursuer=shielded:pursuer&evader=you&seed=4")
    page.keyboard.down("ArrowUp")
    desk.play(9)
    page.keyboard.up("ArrowUp")
    assert page.get_attribute("body", "data-phase") == "over"
    ended = desk.match("replay().states")
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    with Image.open(desk.save(tmp_path / "card.png", "#show")) as card:
        assert card.size == (1200, 630)
    with page.expect_download() as film:
        page.click("#film")
        assert page.is_disabled("#film")
        desk.let_pass(desk.match("seconds") / 3 + 0.3)
        assert float(page.input_value("#moment")) == len(ended) - 1, "all of it is shown"
        desk.let_pass(2)
    film.value.save_as(tmp_path / film.value.suggested_filename)
    assert (tmp_path / "apollonius.webm").read_bytes().startswith(b"\x1aE\xdf\xa3"), "Matroska's first bytes"
    link = page.evaluate("navigator.clipboard.readText()").removeprefix(desk.address)
    assert "It works on this computer only" in page.inner_text("#message")
    page = desk.open(link)
    seconds = f"{(len(ended) - 1) / 10:.1f}\u00a0s"
    assert page.inner_text("#goal") == f"Somebody fled for {seconds}. Then it is your turn"
    desk.let_pass(9)
    assert desk.match("replay().states") == ended, "it plays by itself"
    desk.let_pass(0.5)
    assert page.inner_text("#go") == f"Beat this: {seconds}"
    page.click("#go")
    playwright.expect(page.locator("#goal")).to_have_text("You are blue: survive 100\u00a0s")
    page.wait_for_selector("#go:enabled")
    assert desk.match("replay().states[0]") == ended[0]
    assert desk.match("players.pursuer[0].name") == "shielded:pursuer"
    for damaged in (link[:-20], link[:30] + "A" * 9, "#replay=", link + "A" * 20_000):
        page = desk.open(damaged)
        assert page.inner_text("#message") == "The link's game cannot be played again; copy the whole link"


def test_six_pursuers_of_one_training_play_the_same_start(desk):
    page = desk.open("?level=3")
    assert page.inner_text("#goal") == "3. Red learns to hunt; blue stands still"
    lesson = "apollonius.page.lesson.matches"
    assert len(page.evaluate(f"{lesson}.map(({{ start }}) => JSON.stringify(start.evader))")) == 6
    assert page.evaluate(f"new Set({lesson}.map(({{ start }}) => start)).size") == 1
    desk.let_pass(1)
    assert page.evaluate(f"{lesson}[0].seconds") > 1, "nobody presses a button"
    desk.let_pass(11)
    outcomes = page.evaluate(f"{lesson}.map(({{ outcome }}) => outcome)")
    assert outcomes[-1] == "captured"
    assert len(set(outcomes)) > 1
    assert page.inner_text("#six button:last-child").startswith("your red\ncaught")
    label = page.get_attribute("#curve", "aria-label")
    assert re.match(r"Caught: 0\s%: \d+\s%, 2\s%: .* your red: \d+\s%$", label)
    page.click("#go")
    paused = page.evaluate(f"{lesson}[0].states.length")
    desk.let_pass(1)
    assert page.evaluate(f"{lesson}[0].states.length") == paused
    page.click("#let-blue")
    playwright.expect(page.locator("#goal")).to_have_text("3. Red learns to hunt; blue flees")
    assert page.get_attribute("#curve", "aria-label") != label
    page.click("#six button:nth-child(4)")
    page.wait_for_selector("#go:enabled")
    assert "pursuer=learner-20&evader=you" in page.url
    assert page.inner_text("#learning output") == "20\u00a0%"
    desk.open("?level=3").click("#next-level")
    playwright.expect(page.locator("#goal")).to_have_text(re.compile("^4. You are red"))


def test_slider_chooses_the_share_of_the_training(desk):
    page = desk.open("?pursuer=learner-0&evader=still&game=paper")
    page.fill("#learning input", "2")
    page.wait_for_selector("body[data-phase=counting]")
    desk.let_pass(0.5)
    assert desk.match("seconds") > 0
    assert "pursuer=learner-12" in page.url, "who only watches need not press a button"
    assert page.is_visible("#curve")
    page = desk.open("?level=2")
    assert page.is_hidden("#learning")


def test_agents_play_a_preview_until_a_person_begins(desk):
    page = desk.open("?level=2")
    assert page.inner_text("#message").startswith("Red is hunting you.\nSpace to begin")
    for _ in range(20):
        desk.let_pass(0.5)
    assert page.evaluate("apollonius.page.attract.match.seconds") > 5
    assert page.inner_text("#clock") == "40.0"
    assert desk.match("states.length") == 1
    page.keyboard.press("Space")
    assert page.evaluate("apollonius.page.attract") is None
    desk.let_pass(1.75)
    assert page.get_attribute("body", "data-phase") == "playing"
    page.emulate_media(reduced_motion="reduce")
    desk.open("?level=2")
    desk.let_pass(1)
    assert page.evaluate("apollonius.page.attract") is None
    desk.open("?level=3")
    assert page.inner_text("#go") == "Resume"
    page.emulate_media(reduced_motion="no-preference")


@pytest.mark.parametrize("people", [1, 2])
def test_game_fits_on_a_phone_screen(phone, people):
    page = phone.open(f"?pursuer={'you' if people == 2 else 'still'}&evader=you")
    pads = ["#pad-pursuer", "#pad-evader"][2 - people :]
    sizes = [(375, 667), (667, 375)]
    for size in sizes:
        within(page, size, ["#clock", "#go", "#again", "#next", "#why", "#menu", "#draw", *pads])
    phone.end_after(3)
    for size in sizes[::-1]:
        within(page, size, ["#clock", "#go", "#download", "#moment"])


def within(page, size, names):
    """On a screen of this size, parts of the page are wholly on it, beside the arena and beside each other."""
    page.set_viewport_size({"width": size[0], "height": size[1]})
    boxes = {name: page.locator(name).bounding_box() for name in [*names, ".arena"]}
    for name, box in boxes.items():
        assert 0 <= box["x"] <= size[0] + 0.5 - box["width"], name
        assert 0 <= box["y"] <= size[1] + 0.5 - box["height"], name
    for (name, one), (rival, two) in itertools.combinations(boxes.items(), 2):
        beside = one["x"] + one["width"] <= two["x"] + 0.5 or two["x"] + two["width"] <= one["x"] + 0.5
        above = one["y"] + one["height"] <= two["y"] + 0.5 or two["y"] + two["height"] <= one["y"] + 0.5
        assert beside or above, (name, rival)


def test_two_people_share_a_touch_screen(phone):
    page = phone.open("?pursuer=you&evader=you")
    assert page.inner_text("#message") == "Start to begin; red has the left pad, blue the right one."
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
    page.keyboard.down("KeyW")
    page.keyboard.down("ArrowRight")
    phone.let_pass(0.5)
    assert phone.match("actions.at(-1)") == [7, 3]
    for key in ("KeyW", "ArrowRight"):
        page.keyboard.up(key)


def test_agents_play_at_any_speed_and_a_hidden_tab_pauses(desk):
    page = desk.open("?pursuer=still&evader=still")
    page.select_option("#speed", "10")
    page.keyboard.press("Space")
    desk.let_pass(1.5)
    assert 8 < desk.match("seconds") < 15
    assert page.inner_text("#pursuer-name") == "stands still"
    page.evaluate(
        """() => {
          Object.defineProperty(document, "hidden", { value: true });
          document.dispatchEvent(new Event("visibilitychange"));
        }"""
    )
    assert page.get_attribute("body", "data-phase") == "paused"


def test_why_shows_every_active_robot(desk):
    """What agents think best is what they then do."""
    page = desk.open("?pursuer=pursuer&evader=evader&game=team-2v1/office&seed=3")
    page.keyboard.press("KeyV")
    assert page.get_attribute("#why", "aria-pressed") == "true"
    page.click("#go")
    desk.let_pass(1)
    known = page.evaluate(
        """async () => {
          const { known } = await import("./why.js");
          const { game, state, players } = apollonius.page.match;
          state.pursuer[0].status = "hit_obstacle";
          const values = (who) => players[who.role][who.number].values(game, state, who);
          const { leads, robots } = known(game, [state], ["values", "brakes", "regions"], values);
          apollonius.page.match.step();
          return { robots, leads: [...leads].filter((lead) => !Number.isNaN(lead)) };
        }"""
    )
    assert [(robot["role"], robot["number"]) for robot in known["robots"]] == [("pursuer", 1), ("evader", 0)]
    assert [robot["values"].index(1) for robot in known["robots"]] == desk.match("actions.at(-1)")[1:]
    assert all(robot["stops"][1] for robot in known["robots"]), "at rest or nearly so, they can brake"
    assert min(known["leads"]) < 0 < max(known["leads"])


def test_agent_that_fails_to_load_is_reported(desk):
    page = desk.open("?pursuer=still")
    page.route("**/agents/*", lambda route: route.fulfill(status=404))
    page.click("#menu")
    page.select_option("#pursuer", "P_curriculum")
    page.click("#play")
    playwright.expect(page.locator("#message")).to_have_text(re.compile("P_curriculum cannot be loaded"))
    assert page.is_disabled("#go")
    page.unroute("**/agents/*")
    page.click("#menu")
    page.select_option("#pursuer", "random")
    page.click("#play")
    page.wait_for_selector("#go:enabled")
    (complaint,) = desk.complaints
    assert "404" in complaint
    desk.complaints.clear()


def test_person_leads_a_team_to_the_end_of_its_game(desk, tmp_path):
    page = desk.open("?pursuer=you&evader=shielded:evader&game=team-3v1&seed=2")
    assert page.inner_text("#goal") == "You are red 1 of 3: catch blue within 100\u00a0s"
    page.keyboard.press("Space")
    page.keyboard.down("ArrowUp")
    out = "You are out. Your team plays on."
    for _ in range(40):
        desk.let_pass(0.5)
        if page.inner_text("#message") == out:
            break
    assert page.inner_text("#message") == out
    page.keyboard.press("Space")
    page.keyboard.press("Space")
    desk.let_pass(1.75)
    assert page.inner_text("#message") == out, "also after a pause"
    page.keyboard.up("ArrowUp")
    desk.finish()
    assert re.match(r"Your team caught blue after [\d.]+\u00a0s\. You win!", page.inner_text("#message"))
    replay = load_replay(desk.save(tmp_path / "game.json"))
    assert (replay.pursuer, replay.outcome.name) == ("you+shielded:pursuer", "CAPTURED")
    assert replay.actions.shape[1] == 4
    assert set(replay.actions[:20, 0]) == {7}
    assert replay.first_difference() is None


@pytest.fixture(scope="module")
def spiral():
    """The player in the document, of which `spiral.wasm` is made."""
    document = (REPOSITORY / "docs" / "how-to" / "export.md").read_text()
    names = {"apollonius": apollonius, "jnp": jnp}
    exec(re.search(r"class Spiral.*?\n\n\n", document, re.DOTALL)[0], names)
    return names["Spiral"]()


def test_player_of_the_document_plays_on_the_page_as_in_python(desk, spiral, tmp_path):
    desk.open("?pursuer=spiral&evader=flee-aware&seed=2")
    desk.play(0.25)
    desk.finish()
    replay = load_replay(desk.save(tmp_path / "game.json"))
    assert replay.first_difference() is None
    game = make_game("paper")

    @jax.jit
    @jax.vmap
    def act(row):
        return spiral(look(game, as_state(row, jnp.asarray(0)), Role.PURSUER), (), jnp.uint32(0))[0]

    assert len(np.unique(replay.actions[:, 0])) > 1
    np.testing.assert_array_equal(replay.actions[:, 0], act(jnp.asarray(replay.states[:-1])))


def test_spiral_wasm_is_built_from_the_player_of_the_document(spiral):
    assert sources_digest(sources([player_program(spiral)])) == SPIRAL


def test_write_player_refuses_continuous_players_and_a_missing_compiler(tmp_path, monkeypatch):
    smooth = find_player("P_smooth", Role.PURSUER, make_game("paper")).policy
    with pytest.raises(InvalidInput, match=r"player = .* discrete actions and without a memory"):
        write_player(smooth, tmp_path / "smooth.wasm")
    monkeypatch.setattr(programs, "find_spec", lambda module: None)
    with pytest.raises(InvalidInput, match=r"ziglang = missing .* pip install ziglang"):
        programs.compile_programs([], ())


def test_page_has_room_for_as_many_movers_as_its_programs():
    numbers = re.search(
        r"MOST_MOVERS = \{ shuttles: (\d+), doors: (\d+), walkers: (\d+) \}", (PAGE / "game.js").read_text()
    )
    assert numbers
    assert [*map(int, numbers.groups())] == [SHUTTLES, DOORS, WALKERS]
