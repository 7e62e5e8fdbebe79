"""A game as a moving picture: as many frames as its time takes, robots where they are, and its course in words."""

from dataclasses import replace

import imageio_ffmpeg
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image, ImageColor

from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.evaluate.match import Match, begin
from apollonius.game.dynamics import stack_actions
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.observe import tracking
from apollonius.play import rollout
from apollonius.play.random_bits import random_bits_of
from apollonius.play.replay import Replay
from apollonius.show import style
from apollonius.show.animation import LINE, MARGIN, Captioned, frames, save_animation
from apollonius.show.canvas import SIZE, Canvas, save_side_by_side
from apollonius.show.fog import fog
from apollonius.show.palette import OBSTACLE, PAPER
from tests.show.conftest import BLUE, RED, WHITE, colour_at

STEPS = 12


@pytest.fixture
def replay():
    """Both robots drive straight: the pursuer to the right, the evader upwards."""
    along = np.linspace(0, 2, STEPS + 1, dtype=np.float32)
    still = np.zeros_like(along)
    pursuer = np.stack([2 + along, still + 5, still + 1, still], axis=1)
    evader = np.stack([still + 8, 6 + along, still + 1, still + np.float32(np.pi / 2)], axis=1)
    states = np.concatenate([pursuer, evader], axis=1)
    return Replay(make_game("paper"), "P", "E", 0, 1, 0, states, np.full((STEPS, 2), 4, np.int32), Outcome.NO_RESULT)


def test_every_state_is_a_frame_with_both_robots_their_trails_and_the_reach_of_a_capture(replay):
    """The pursuer's head is behind its middle, the evader's disc around it: they can be told apart without colours."""
    pictures = list(frames(replace(replay, game=replace(replay.game, capture_distance=1.0))))
    assert len(pictures) == STEPS + 1
    for picture, (x, y, _, _, to_x, to_y, *_) in zip(pictures, replay.states, strict=True):
        signs = (x - 0.11, y + 0.11), (x + 0.18, y), (x + 0.11, y + 0.11), (to_x, to_y - 0.1), (to_x, to_y + 0.26)
        assert [colour_at(picture, *at) for at in signs] == [RED, RED, WHITE, BLUE, BLUE]
    around = [(2 + np.cos(angle), 5 + np.sin(angle)) for angle in np.arange(0.05, 6.3, 0.01)]
    trails = [[(2 + part, 5), (8, 6 + part)] for part in np.linspace(0.1, 1.5)]
    for picture, points, least, most in (
        (pictures[0], around, 0.9, 1),
        (pictures[0], [(3.4, 5)], 0, 0),
        (pictures[-1], [pursuer for pursuer, _ in trails], 1, 1),
        (pictures[-1], [evader for _, evader in trails], 1, 1),
    ):
        assert least <= np.mean([colour_at(picture, *point) != WHITE for point in points]) <= most


def test_fog_is_what_a_side_believed_while_the_game_was_played(words_of):
    """Cell by cell, in every state; it holds the evader, its colour lies there, and words say so."""
    game = charted(replace(find_game("lidar"), max_steps=40))
    match = Match.of_names(game, "intercept", "flee-aware", 3, seed=5)
    starts, key = begin(match)
    number = jnp.array([2])

    def step(games):
        """Return the games after a step, their states before it, the actions, and what was believed in it."""
        after, moves = rollout.step_games(
            game, match.pools, games, random_bits_of(key, number, games.state.steps), observes=False
        )
        track, before = jax.tree.map(lambda leaf: leaf[0], (after.sides.pursuer.track, games.state))
        believed = tracking.believed(game, track, before, Role.PURSUER).sight.belief >= 0
        held = believed.ravel()[game.arena.chart.nearest_cell(before.evader.x, before.evader.y)]
        actions = stack_actions(*(side.action[0] for side in moves.sides))
        return after, (jnp.stack(jax.tree.leaves(before.robots)), actions, believed, held)

    @jax.jit
    def course(starts):
        first = jax.tree.map(lambda leaf: leaf[2:3], starts)
        games = rollout.begin(game, first, match.pools, random_bits_of(key, number, -1 + 0 * number))
        return jax.lax.scan(lambda games, _: step(games), games, length=40)[1]

    rows, actions, believed, held = map(np.asarray, course(starts))
    bare = replace(game, arena=replace(game.arena, chart=None))
    replay = Replay(bare, "intercept", "flee-aware", 5, 3, 2, rows, actions[:-1], Outcome.NO_RESULT)
    _, shaded = fog(replay)
    np.testing.assert_array_equal(shaded, believed)
    assert held.all()
    assert 0 < shaded[-1].sum() < shaded[0].sum()
    picture = next(frames(replay, [20]))
    x, y = (np.argwhere(shaded[20])[0][::-1] + 0.5) / 4
    clear = (np.argwhere(~shaded[20])[0][::-1] + 0.5) / 4
    assert colour_at(picture, x, y)[2] - colour_at(picture, x, y)[0] > 20
    assert colour_at(picture, *clear) == WHITE
    assert "shaded: where the evader can be" in words_of(replay, [0])
    assert fog(replace(replay, game=make_game("paper"))) is None


def test_obstacles_and_the_territory_are_where_they_are(replay):
    arena = make_game("territory").arena
    polygon, (disc, *_), goal = Polygon(((1.0, 8.0), (3.0, 8.0), (1.0, 9.0))), arena.discs, arena.territory
    game = replace(replay.game, arena=replace(arena, discs=(disc,), polygons=(polygon,)))
    picture, grey = next(frames(replace(replay, game=game))), ImageColor.getrgb(OBSTACLE)
    inside = (disc.x + 0.8 * disc.radius, disc.y), (1.2, 8.8), (2.8, 8.05)
    outside = (disc.x + 1.2 * disc.radius, disc.y), (2.8, 8.8), (goal.x, goal.y)
    assert [colour_at(picture, *place) for place in (*inside, *outside)] == [grey] * 3 + [WHITE] * 3
    assert colour_at(picture, goal.x + goal.radius, goal.y) != WHITE


def test_pictures_side_by_side_are_whole_and_so_are_their_captions(tmp_path):
    """Captions of two lines lie on no picture; one that is too large is made smaller."""
    sizes = {"red": (100, 60), "lime": (30, 50), "blue": (100, 100), "yellow": (200, 80)}
    known, ink = np.array([ImageColor.getrgb(colour) for colour in (*sizes, PAPER)]), set()
    for columns in (1, 2, 4):
        pictures = {f"one\n{colour}": Image.new("RGB", size, colour) for colour, size in sizes.items()}
        save_side_by_side(pictures, tmp_path / "all.png", columns, 100)
        with Image.open(tmp_path / "all.png") as drawn:
            content = np.asarray(drawn.convert("RGB"))
        assert content.shape == (4 // columns * 176 + 16, columns * 116 + 16, 3)
        for colour, (width, height) in zip(known, [*list(sizes.values())[:3], (100, 40)], strict=False):
            places = np.argwhere((content == colour).all(axis=2))
            assert [*np.ptp(places, axis=0) + 1, len(places)] == [height, width, height * width]
        ink.add((content[:, :, None] != known).any(axis=3).all(axis=2).sum())
    assert len(ink) == 1


def test_a_frame_says_who_plays_the_time_the_distance_and_at_the_end_the_outcome(replay, words_of):
    first = words_of(replay, [0])
    assert {"pursuer P", "evader E", "capture within 0.3 m", "0.0 s"} <= set(first)
    assert f"distance {np.hypot(6, 1):.2f} m" in first
    assert "0.5 s, 2 x real time" in words_of(replay, [5], 2.0)
    assert "no result after 1.2 s" in words_of(replay, [STEPS])
    (name,) = (word for word in words_of(replace(replay, pursuer="long-" * 30), [0]) if word.startswith("pursuer"))
    assert name.startswith("pursuer long-")
    assert len(name) < 60


def durations(path):
    with Image.open(path) as picture:
        found = []
        for frame in range(picture.n_frames):
            picture.seek(frame)
            picture.load()
            found.append(picture.info["duration"])
        return found, picture.convert("RGB")


@pytest.mark.parametrize(
    ("name", "speed", "count", "seconds"),
    [
        ("new/game.gif", 1.0, 13, 1.2),
        ("game.webp", 1.0, 13, 1.2),
        ("game.gif", 3.0, 13, 0.4),
        ("game.gif", 100.0, 2, 0.02),
    ],
)
def test_an_animation_takes_as_long_as_it_should(replay, tmp_path, name, speed, count, seconds):
    """Steps are left out where browsers would refuse to show them so quickly; the last one is there."""
    save_animation(replay, tmp_path / name, speed)
    shown, last = durations(tmp_path / name)
    assert last.size == (SIZE + 2 * MARGIN, SIZE + 3 * LINE + 2 * MARGIN)
    assert len(shown) == count
    assert min(shown) >= 20
    assert (sum(shown[:-1]), shown[-1]) == (pytest.approx(1000 * seconds, abs=10), 2000)
    assert np.linalg.norm(np.subtract(colour_at(last, 4, 5), RED)) < 40


def test_an_mp4_has_every_frame_and_stays_at_the_end(replay, tmp_path):
    save_animation(replay, tmp_path / "game.mp4", 4.0)
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "game.mp4"))
    assert count == STEPS + 1 + 2 * 40
    assert seconds == pytest.approx(count / 40, abs=0.11)


@pytest.mark.parametrize(("x_max", "y_max", "size"), [(20.0, 10.0, (480, 240)), (10.0, 20.3, (236, 480))])
def test_an_arena_that_is_no_square_keeps_its_shape_and_the_words_their_width(replay, x_max, y_max, size):
    wide = replace(replay, game=replace(replay.game, arena=replace(replay.game.arena, x_max=x_max, y_max=y_max)))
    assert Canvas(wide.game).picture().size == size
    picture = next(frames(wide))
    assert picture.width == max(size[0], 400) + 2 * MARGIN
    assert all(side % 2 == 0 for side in picture.size)
    assert Captioned(wide).corner[0] == (picture.width - size[0]) // 2


def save_panel(path):
    with style.picture(path):
        pass


@pytest.mark.parametrize("name", ["g.gif", "g.mp4", "panel.png", "gallery.png"])
def test_a_full_disk_spares_the_old_file(replay, tmp_path, name):
    """No file may grow beyond a kilobyte, so that every writer fails in the middle."""
    resource = pytest.importorskip("resource")
    write = {
        "panel.png": save_panel,
        "gallery.png": lambda path: save_side_by_side({"paper": Canvas(replay.game).picture()}, path, 1, SIZE),
    }.get(name, lambda path: save_animation(replay, path))
    (tmp_path / name).write_bytes(b"good")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match=r"too large|whole video"):
            write(tmp_path / name)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [(name, b"good")]
    write(tmp_path / name)
    assert (tmp_path / name).stat().st_size > 1000
