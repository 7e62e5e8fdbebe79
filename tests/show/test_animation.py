"""Pictures show what they are given: games in as many frames as they take, shapes to scale, means, bars and values."""

import json
import subprocess
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgba
from matplotlib.figure import Figure
from PIL import Image, ImageColor, ImageDraw, ImageSequence

from apollonius.agents.network import make_network
from apollonius.agents.trained import Greedy
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game
from apollonius.evaluate.match import Match, draw_starts
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import stack_actions
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_teams, make_game
from apollonius.game.types import GameState, Outcome, RobotState, Role
from apollonius.observe import tracking
from apollonius.observe.view import look
from apollonius.play import rollout
from apollonius.play.random_bits import random_bits_of
from apollonius.play.replay import Replay, as_rows, play_actions
from apollonius.show import palette, style
from apollonius.show.animation import LINE, MARGIN, fog, frames, save_animation
from apollonius.show.arena import draw_arena
from apollonius.show.canvas import HEIGHT as SIZE
from apollonius.show.canvas import Canvas
from apollonius.show.palette import DARK, EVADER, LIGHT, OBSTACLE, PAPER, PURSUER
from apollonius.show.report import bundle, for_page
from apollonius.show.slices import _TURNS, _draw_actions, _draw_opponent, save_slice, slice_values
from apollonius.show.style import draw_rate, draw_seeds, draw_strips, smooth
from tests.acting import state_of
from tests.documents import REPOSITORY
from tests.web.test_parity import needs_node

STEPS = 12
RED, BLUE, WHITE = map(ImageColor.getrgb, (PURSUER, EVADER, PAPER))


def colour_at(picture, x, y):
    return picture.getpixel((MARGIN + round(x / 10 * SIZE), MARGIN + 2 * LINE + round((10 - y) / 10 * SIZE)))


@pytest.fixture
def words_of(monkeypatch):
    """A function that returns the texts of some frames, which lie inside them and not on each other."""
    said, write, taken = [], ImageDraw.ImageDraw.text, []

    def listen(self, point, text, fill, font, anchor="la"):
        said.append(text)
        left, top, right, bottom = self.textbbox(point, text, font, anchor)
        assert min(left, top, self.im.size[0] - right, self.im.size[1] - bottom) >= 0
        for draw, *box in taken:
            assert draw is not self or left >= box[2] or box[0] >= right or top >= box[3] or box[1] >= bottom
        taken.append((self, left, top, right, bottom))
        write(self, point, text, fill, font, anchor)

    monkeypatch.setattr(ImageDraw.ImageDraw, "text", listen)
    return lambda *given: (said.clear(), list(frames(*given)), [*said])[-1]


@pytest.fixture
def replay():
    """Both robots drive straight: the pursuer to the right, the evader upwards."""
    along = np.linspace(0, 2, STEPS + 1, dtype=np.float32)
    still = np.zeros_like(along)
    pursuer = np.stack([2 + along, still + 5, still + 1, still], axis=1)
    evader = np.stack([still + 8, 6 + along, still + 1, still + np.float32(np.pi / 2)], axis=1)
    states = np.concatenate([pursuer, evader], axis=1)
    return Replay(make_game("paper"), "P", "E", 0, 1, 0, states, np.full((STEPS, 2), 4, np.int32), Outcome.NO_RESULT)


def test_every_state_has_a_frame_with_robots_trails_and_capture_circle(replay):
    """The pursuer's head is behind its middle, the evader's disc around it: they can be told apart without colours."""
    pictures = list(frames(replace(replay, game=replace(replay.game, capture_distance=1.0))))
    assert len(pictures) == STEPS + 1
    for picture, (x, y, _, _, to_x, to_y, *_) in zip(pictures, replay.states, strict=True):
        signs = (x - 0.11, y + 0.11), (x + 0.18, y), (x + 0.11, y + 0.11), (to_x, to_y - 0.1), (to_x, to_y + 0.26)
        assert [colour_at(picture, *at) for at in signs] == [RED, RED, WHITE, BLUE, BLUE]
    turned = next(frames(replace(replay, states=np.where(np.arange(8) == 3, np.float32(np.pi / 4), replay.states))))
    signs = (-0.155, 0), (0, -0.155), (0.127, 0.127), (0, 0.155)
    assert [colour_at(turned, 2 + x, 5 + y) for x, y in signs] == [RED, RED, RED, WHITE]
    around = [(2 + np.cos(angle), 5 + np.sin(angle)) for angle in np.arange(0.05, 6.3, 0.01)]
    trails = [[(2 + part, 5), (8, 6 + part)] for part in np.linspace(0.1, 1.5)]
    for picture, points, least, most in (
        (pictures[0], around, 0.9, 1),
        (pictures[0], [(3.4, 5)], 0, 0),
        (pictures[-1], [pursuer for pursuer, _ in trails], 1, 1),
        (pictures[-1], [evader for _, evader in trails], 1, 1),
    ):
        assert least <= np.mean([colour_at(picture, *point) != WHITE for point in points]) <= most


def test_fog_matches_the_belief_during_the_game(words_of):
    """Cell by cell, in every state; it holds the evader, its colour lies there, and words say so."""
    game = with_chart(replace(find_game("lidar"), max_steps=40))
    match = Match.of_names(game, "pure-pursuit", "flee", 3, seed=5)
    (starts, key), number = draw_starts(match), jnp.array([2])
    first = jax.tree.map(lambda leaf: leaf[2:], starts)

    def step(games, _):
        """Return the games after a step, their states before it, the actions, and what was believed in it."""
        bits, before = random_bits_of(key, number, games.state.steps), games.state
        games, moves = rollout.step_games(game, match.pools, games, bits, with_obs=False)
        track, before = jax.tree.map(lambda leaf: leaf[0], (games.sides.pursuer.track, before))
        believed = tracking.knowledge_of(game, track, before, Role.PURSUER).belief >= 0
        actions = stack_actions(*(side.action[0] for side in moves.sides))
        return games, (jnp.stack(jax.tree.leaves(before.robots)), actions, believed)

    @jax.jit
    def course(first):
        games = rollout.init_games(game, first, match.pools, random_bits_of(key, number, -1 + 0 * number))
        return jax.lax.scan(step, games, length=40)[1]

    rows, actions, believed = map(np.asarray, course(first))
    bare = replace(game, chart=None)
    replay = Replay(bare, "pure-pursuit", "flee", 5, 3, 2, rows, actions[:-1], Outcome.NO_RESULT)
    _, shaded = fog(replay)
    np.testing.assert_array_equal(shaded, believed)
    held = jax.vmap(game.chart.nearest_cell)(*jnp.asarray(rows[:, 4:6]).T)
    assert believed.reshape(40, -1)[np.arange(40), held].all()
    assert 0 < shaded[-1].sum() < shaded[0].sum()
    picture = next(frames(replay, [20]))
    x, y = (np.argwhere(shaded[20])[0][::-1] + 0.5) / 4
    clear = (np.argwhere(~shaded[20])[0][::-1] + 0.5) / 4
    assert colour_at(picture, x, y)[2] - colour_at(picture, x, y)[0] > 20
    assert colour_at(picture, *clear) == WHITE
    assert "shaded: where the evader can be" in words_of(replay, [0])
    assert fog(replace(replay, game=make_game("paper"))) is None


def test_frames_show_obstacles_and_the_territory_in_place(replay):
    arena = make_game("territory").arena
    polygon, (disc, *_), goal = Polygon(((1.0, 8.0), (3.0, 8.0), (1.0, 9.0))), arena.discs, arena.territory
    game = replace(replay.game, arena=replace(arena, discs=(disc,), polygons=(polygon,)))
    picture, grey = next(frames(replace(replay, game=game))), ImageColor.getrgb(OBSTACLE)
    inside = (disc.x + 0.8 * disc.radius, disc.y), (1.2, 8.8), (2.8, 8.05)
    outside = (disc.x + 1.2 * disc.radius, disc.y), (2.8, 8.8), (goal.x, goal.y)
    assert [colour_at(picture, *place) for place in (*inside, *outside)] == [grey] * 3 + [WHITE] * 3
    assert colour_at(picture, goal.x + goal.radius, goal.y) != WHITE


def test_frame_text_has_players_time_distance_and_outcome(replay, words_of):
    first = words_of(replay, [0])
    assert {"pursuer P", "evader E", "capture within 0.3 m", "0.0 s"} <= set(first)
    assert f"distance {np.hypot(6, 1):.2f} m" in first
    assert "0.5 s, 2 x real time" in words_of(replay, [5], 2.0)
    assert "no result after 1.2 s" in words_of(replay, [STEPS])
    (name,) = (word for word in words_of(replace(replay, pursuer="long-" * 30), [0]) if word.startswith("pursuer"))
    assert name.startswith("pursuer long-")
    assert len(name) < 60


@pytest.mark.parametrize(
    ("name", "speed", "count", "seconds"),
    [
        ("new/game.gif", 1.0, 13, 1.2),
        ("game.webp", 1.0, 13, 1.2),
        ("game.gif", 3.0, 13, 0.4),
        ("game.gif", 100.0, 2, 0.02),
    ],
)
def test_animation_has_the_duration_of_the_game_at_its_speed(replay, tmp_path, name, speed, count, seconds):
    """Steps are left out where browsers would refuse to show them so quickly; the last one is there."""
    save_animation(replay, tmp_path / name, speed)
    with Image.open(tmp_path / name) as picture:
        pictures = ImageSequence.all_frames(picture)
    shown, last = [picture.info["duration"] for picture in pictures], pictures[-1].convert("RGB")
    assert last.size == (SIZE + 2 * MARGIN, SIZE + 3 * LINE + 2 * MARGIN)
    assert len(shown) == count
    assert min(shown) >= 20
    assert (sum(shown[:-1]), shown[-1]) == (pytest.approx(1000 * seconds, abs=10), 2000)
    assert np.linalg.norm(np.subtract(colour_at(last, 4, 5), RED)) < 40


@pytest.mark.parametrize(("x_max", "y_max", "size"), [(20.0, 10.0, (1120, 560)), (10.0, 20.3, (315, 640))])
def test_frames_keep_the_shape_of_an_oblong_arena(replay, x_max, y_max, size):
    wide = replace(replay, game=replace(replay.game, arena=replace(replay.game.arena, x_max=x_max, y_max=y_max)))
    assert Canvas(wide.game).picture().size == size
    picture = next(frames(wide))
    assert picture.width == max(size[0], 520) + 2 * MARGIN
    left, middle = (picture.width - size[0]) // 2, MARGIN + 2 * LINE + size[1] // 3
    assert picture.getpixel((left - 1, middle)) == WHITE != picture.getpixel((left, middle)), "the wall on the left"


def save_panel(replay, path):
    with style.picture(path):
        pass


@pytest.mark.parametrize(("name", "write"), [("g.gif", save_animation), ("panel.png", save_panel)])
def test_failed_write_keeps_the_old_file(replay, tmp_path, name, write):
    """No file may grow beyond a kilobyte, so that every writer fails in the middle."""
    resource = pytest.importorskip("resource")
    (tmp_path / name).write_bytes(b"good")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match="too large"):
            write(replay, tmp_path / name)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [(name, b"good")]
    write(replay, tmp_path / name)
    assert (tmp_path / name).stat().st_size > 1000


@pytest.fixture
def axes():
    return Figure().subplots()


def test_draw_arena_draws_obstacles_and_the_territory_in_place(axes):
    corners = ((4.0, 8.0), (6.0, 8.0), (5.0, 9.0))
    arena = replace(make_game("territory").arena, polygons=(Polygon(corners),))
    draw_arena(axes, arena)
    *discs, polygon, ring, _ = axes.patches
    for patch, disc in zip([*discs, ring], [*arena.discs, arena.territory], strict=True):
        away = np.hypot(*(patch.get_xy() - (disc.x, disc.y)).T)
        np.testing.assert_allclose(away, disc.radius, rtol=1e-5)
    np.testing.assert_array_equal(polygon.get_xy(), [*corners, corners[0]])
    looks = [(patch.get_fill(), patch.get_linewidth()) for patch in axes.patches[-3:]]
    assert looks == [(True, 0), (False, 1.4), (False, 1.4)]
    assert to_hex(ring.get_edgecolor()) == palette.EVADER
    assert axes.get_aspect() == 1.0
    for low, high in (axes.get_xlim(), axes.get_ylim()):
        assert low < 0 < 10 < high


def test_draw_seeds_shows_mean_and_band_over_the_common_range(axes):
    draw_seeds(axes, [([0.0, 10.0, 20.0], [0.0, 1.0, 2.0]), ([5.0, 15.0, 25.0], [2.5, 2.5, 2.5])], "red", "reward")
    *seeds, mean = axes.get_lines()
    assert len(seeds) == 2
    np.testing.assert_allclose(mean.get_xydata()[[0, -1]], [[5, (0.5 + 2.5) / 2], [20, (2 + 2.5) / 2]])
    assert mean.get_label() == "reward: mean of 2 seeds, 95 % band"
    (band,), half = axes.collections, 12.7062047 / 2  # of Student's t with 1 degree of freedom
    low, high = band.get_datalim(axes.transData).get_points()[:, 1]
    np.testing.assert_allclose([low, high], [1.5 - 2 * half, 1.5 + 2 * half])
    alone = Figure().subplots()
    draw_seeds(alone, [([0, 10], [0.0, 1.0])], "red", "reward")
    assert not alone.collections
    assert [line.get_label() for line in alone.get_lines()] == ["reward"]


def test_draw_rate_shows_the_wilson_interval_as_a_band(axes):
    draw_rate(axes, [0, 100], [5, 10], [10, 10], "red", "captured")
    (line,), (band,) = axes.get_lines(), axes.collections
    np.testing.assert_allclose(line.get_xydata(), [[0, 50], [100, 100]])
    corners = band.get_paths()[0].vertices
    for x, times in ((0, 5), (100, 10)):
        for end in wilson_interval(times, 10):
            assert np.isclose(corners, [x, 100 * end]).all(axis=1).any()


def test_inline_svg_uses_the_colours_of_the_page():
    def draw(axes):
        axes.plot([0, 1], [0, 1], color=palette.PURSUER, label="pursuer")
        axes.set_xlabel("episodes & <more>")

    drawn = style.inline_svg(draw, "a curve")
    assert drawn == style.inline_svg(draw, "a curve")
    assert drawn.startswith('<svg role="img" aria-label="a curve"')
    assert "var(--pursuer)" in drawn
    assert "var(--ink)" in drawn
    assert not any(colour in drawn for colour in (palette.PURSUER, palette.INK, palette.GRID, "http"))
    assert "episodes &amp; &lt;more&gt;" in drawn


def test_smooth_averages_neighbours():
    assert smooth([1.0, 1.0, 4.0, 1.0, 1.0], 3) == pytest.approx([1, 2, 2, 2, 1])


def test_draw_strips_sorts_trainings_by_mean_and_adds_the_interval(axes):
    draw_strips(axes, ["a", "b"], [[[0.5, 0.6], [0.2, 0.3]], [[0.9]]], [(0.2, 0.7), (0.8, 1.0)], ["red", "blue"])
    assert [line.get_color() for line in axes.lines] == ["red", "blue"]
    dots = [list(zip(*line.get_data(), strict=True)) for line in axes.lines]
    assert dots == [[(-0.3, pytest.approx(25)), (0.2, pytest.approx(55))], [(1, 90)]]
    lines = [[path.vertices.tolist() for path in bars.get_paths()] for bars in axes.collections]
    assert lines == [
        [[[-0.3, 20], [-0.3, 30]], [[0.2, 50], [0.2, 60]]], [[[0.35, 20], [0.35, 70]]],
        [[[1, 90], [1, 90]]], [[[1.35, 80], [1.35, 100]]],
    ]  # fmt: skip
    assert [label.get_text() for label in axes.get_xticklabels()] == ["a", "b"]


def contrast(*colours):
    """WCAG 2's contrast of two colours, by their relative luminances."""
    c = np.array([*map(ImageColor.getrgb, colours)]) / 255
    low, high = sorted(np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722])
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_themes_have_sufficient_contrast(theme):
    for ground in ("paper", "panel"):
        assert min(contrast(theme[name], theme[ground]) for name in ("ink", "quiet", "pursuer", "evader")) >= 4.5
    assert min(contrast(theme[name], theme["paper"]) for name in ("obstacle", "other")) >= 3


OPPONENT = RobotState(*map(jnp.float32, (7.5, 7.0, 0.4, -1.0)))
OWN = (0.6, 0.8)
NETWORK = make_network("encoded", width=8, depth=2, key=jax.random.key(1))


@pytest.mark.parametrize("role", Role)
def test_slice_values_match_the_network_in_every_cell(role):
    game = make_game("paper")
    x, y, values = slice_values(Greedy(NETWORK), game, role, OWN, OPPONENT, cells=8)
    np.testing.assert_allclose(x, np.arange(8) * 1.25 + 0.625)
    assert values.shape == (8, 8, 9)
    for row, column in ((0, 0), (2, 5), (7, 1)):
        own = RobotState(*map(jnp.float32, (x[column], y[row], *OWN)))
        pursuer, evader = (own, OPPONENT) if role == Role.PURSUER else (OPPONENT, own)
        observation = NETWORK.observation(look(game, GameState.of_two(pursuer, evader, jnp.int32(0)), role))
        np.testing.assert_allclose(values[row, column], NETWORK(observation), atol=1e-5)


def test_slice_values_are_missing_where_the_body_cannot_be():
    game = make_game("robot")
    x, y, values = slice_values(Greedy(NETWORK), game, Role.PURSUER, OWN, OPPONENT, cells=200)
    missing = np.isnan(values[..., 0])
    x, y = np.meshgrid(x, y)
    for disc in game.arena.discs:
        away = np.hypot(x - disc.x, y - disc.y)
        assert missing[away < disc.radius + 0.14].all()
        assert not missing[(away > disc.radius + 0.2) & (away < disc.radius + 0.5)].any()
    assert missing[0].all()
    assert not missing[10, 10]


def test_slice_titles_name_the_agent_and_the_states(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, _: drawn.append(figure))
    save_slice(Greedy(NETWORK), Role.PURSUER, "P", make_game("robot"), OWN, OPPONENT, tmp_path / "slice.png")
    assert [axes.get_title(loc="left") for axes in drawn[0].axes if axes.get_title(loc="left")] == [
        "P: value of its best action\nat 0.6 m/s, heading 46°",
        "P: its best action\nevader at (7.5, 7) m, 0.4 m/s, heading -57°",
    ]


@pytest.mark.parametrize("size", [2.0, 10.0, 100.0])
def test_opponent_arrow_scales_with_the_arena(size):
    axes = Figure().subplots()
    _draw_opponent(axes, Role.PURSUER, OPPONENT, Game(arena=Arena(x_max=size, y_max=size)))
    away = np.hypot(*(axes.patches[-1].get_xy() - [7.5, 7.0]).T)
    assert away.max() == pytest.approx(0.07 * size)


def test_best_action_is_drawn_as_turn_colour_and_acceleration_sign():
    places = np.arange(32.0)
    best = (places // 11 + 3 * (places[:, None] // 11)).astype(int)
    values = np.eye(9)[best]
    values[:2] = np.nan
    axes = Figure().subplots()
    _draw_actions(axes, (places, places, values))
    (mesh,), chosen = axes.collections, np.arange(1, 32, 2)
    colours, turns = mesh.to_rgba(mesh.get_array()), [to_rgba(colour) for colour in _TURNS.values()]
    np.testing.assert_allclose(colours[2:], np.array(turns)[best % 3][2:])
    assert mesh.get_array().mask[:2].all()
    for level, line in enumerate(axes.lines):
        rows, columns = np.nonzero(best[np.ix_(chosen, chosen)][1:] // 3 == level)
        np.testing.assert_array_equal(line.get_xydata(), np.stack([chosen[columns], chosen[rows + 1]], axis=1))


RECORDER = """
const calls = [];
const context = new Proxy({}, {
  get(target, name) {
    return target[name] ?? ((...given) => calls.push([name, ...given, target.fillStyle, target.strokeStyle]));
  },
});
const canvas = { clientWidth: 420, clientHeight: 420, getContext: () => context };
globalThis.devicePixelRatio = 2;
const colours = { pursuer: "red", evader: "blue", obstacle: "grey", paper: "white", ink: "black", grid: "pale" };
draw(canvas, { ...replay, states: statesOf(replay), at: step, colours });
console.log(JSON.stringify([canvas, calls]));
"""
"""A canvas that keeps what the report's script draws of a replay at a step."""


def drawn_by_script(replay, step):
    script = bundle(REPOSITORY / "apollonius" / "show" / "replay.js")
    given = f"{script}\nconst [replay, step] = {json.dumps([for_page(replay), step])};{RECORDER}"
    node = ["node", "--input-type=module"]
    return json.loads(subprocess.run(node, input=given, capture_output=True, text=True, check=True, timeout=60).stdout)


@needs_node
def test_replay_script_draws_the_game_in_metres_between_two_steps(replay):
    arena = Arena(discs=(Disc(3.0, 4.0, 0.5),), polygons=(Polygon(((6.0, 6.0), (8.0, 6.0), (7.0, 8.0))),))
    states = np.float32([[1, 2, 0.5, 3.0, 8, 8, 1, 0], [2, 2, 0.7, -3.0, 8, 7, 1, 0], [3, 2, 0.7, -3.0, 8, 6, 1, 0]])
    canvas, calls = drawn_by_script(replace(replay, game=Game(arena=arena), states=states), 0.5)

    def drawn(name, colour):
        """Return the arguments of the calls of one kind that were made in a colour, filled or stroked."""
        return [call[1:-2] for call in calls if call[0] == name and colour in call[-2:]]

    assert (canvas["width"], canvas["height"]) == (840, 840)
    (scale, _, _, upwards, x, y) = next(call[1:7] for call in calls if call[0] == "setTransform")
    assert (scale, upwards) == (840 / 10.7, -scale), "10 m and a margin of 0.35 m on both sides"
    assert (x, y) == pytest.approx((0.35 * scale, 10.35 * scale))
    assert [3, 4, 0.5] in [call[:3] for call in drawn("arc", "grey")]
    assert drawn("lineTo", "grey")[:3] == [[6, 6], [8, 6], [7, 8]]
    assert [1.5, 2, 0.3] in [call[:3] for call in drawn("arc", "red")]
    assert [8, 7.5] in [call[:2] for call in drawn("arc", "blue")]
    nose = drawn("lineTo", "red")[-4]
    assert nose[0] < 1.5, "it turns the short way, and looks to the left"
    assert nose[1] == pytest.approx(2, abs=1e-3)


@pytest.fixture(scope="module")
def of_teams():
    """Two against two, straight ahead: one pursuer leaves the walls, later the other catches the first evader."""
    start = state_of([(9.75, 2, 1), (2, 5, 1)], [(3.15, 5.25), (5, 8, 1, np.pi / 2)], [(0, 0), (0, 0)])
    game, actions = in_teams(Game(max_steps=12), 2, 2), jnp.full((12, 4), 4)
    states, outcomes = play_actions(game, start, actions)
    end = Outcome(int(outcomes[-1]))
    return Replay(game, "P", "E", 0, 1, 0, as_rows(jax.device_get(states)), np.asarray(actions), end)


def test_team_frames_number_the_robots_and_cross_out_inactive_ones(of_teams, words_of):
    assert of_teams.in_play().sum(axis=0).tolist() == [3, 13, 10, 13]
    assert for_page(of_teams)["until"] == [3, None, 10, None]
    said = words_of(of_teams, [0, 12])
    assert said[:3] == ["capture within 0.3 m", "2 pursuers P", "2 evaders E"]
    assert said[3:9] == ["1", "2", "1", "2", "0.0 s", "2 v 2 in play, distance 1.18 m"]
    first, last = frames(of_teams, [0, 12])
    places = of_teams.states[-1].reshape(4, 4)[:, :2]
    apart = np.hypot(*(places[3] - places[1]))
    assert said[9:] == ["2", "2", "no result after 1.2 s", f"1 v 1 in play, distance {apart:.2f} m"]

    beside = 0.09  # m; in an arrowhead
    assert [colour_at(first, 9.75 - beside, 2), colour_at(first, 2 - beside, 5)] == [RED, RED]
    x, y = places[2]
    assert colour_at(last, x, y) == BLUE
    assert WHITE not in (colour_at(last, x + 0.07, y + 0.07), colour_at(last, x - 0.07, y - 0.07))
    assert colour_at(last, x, y + 0.14) == WHITE, "off the arms of a cross, outside the ring of its start"
    x, y = places[1]
    assert colour_at(last, x - beside, y + 0.05) == RED


@needs_node
def test_replay_script_draws_every_robot_of_a_team(of_teams):
    _, calls = drawn_by_script(of_teams, 12)
    assert [call[1] for call in calls if call[0] == "fillText"] == ["1", "2", "1", "2"]
    assert [call[0] == "arc" and call[3] == 0.3 for call in calls].count(True) == 1
