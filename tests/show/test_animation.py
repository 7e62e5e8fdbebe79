"""A game as a moving picture: as many frames as its time takes, robots where they are, and in words what goes on."""

from dataclasses import replace

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image, ImageColor, ImageDraw

from apollonius.game.presets import make_game
from apollonius.game.types import Outcome
from apollonius.io.errors import InvalidInput
from apollonius.play.replay import Replay
from apollonius.show import style
from apollonius.show.animation import LINE, MARGIN, Captioned, frames, save_animation
from apollonius.show.arena import save_picture
from apollonius.show.canvas import SIZE, Canvas, save_gallery
from apollonius.show.palette import EVADER, PAPER, PURSUER

STEPS = 12
LEFT, TOP = MARGIN, MARGIN + 2 * LINE
"""The arena's upper left corner in a frame."""


@pytest.fixture
def replay():
    """Both robots drive straight: the pursuer to the right, the evader upwards."""
    along = np.linspace(0, 2, STEPS + 1, dtype=np.float32)
    still = np.zeros_like(along)
    pursuer = np.stack([2 + along, still + 5, still + 1, still], axis=1)
    evader = np.stack([still + 8, 6 + along, still + 1, still + np.float32(np.pi / 2)], axis=1)
    states = np.concatenate([pursuer, evader], axis=1)
    return Replay(make_game("paper"), "P", "E", 0, 1, 0, states, np.full((STEPS, 2), 4, np.int32), Outcome.NO_RESULT)


def colour_at(picture, x, y):
    return picture.getpixel((LEFT + round(x / 10 * SIZE), TOP + round((10 - y) / 10 * SIZE)))


def words_of(monkeypatch, replay, step, speed=1.0):
    """What a frame says."""
    said, write = [], ImageDraw.ImageDraw.text

    def listen(self, place, text, *arguments, **options):
        said.append(text)
        write(self, place, text, *arguments, **options)

    monkeypatch.setattr(ImageDraw.ImageDraw, "text", listen)
    list(frames(replay, [step], speed))
    return said


def test_every_state_is_a_frame_with_both_robots_where_they_are(replay):
    """The pursuer is full and the evader a ring, which can be told apart without colours."""
    pictures = list(frames(replay))
    assert len(pictures) == STEPS + 1
    for picture, state in zip(pictures, replay.states, strict=True):
        assert colour_at(picture, *state[:2]) == ImageColor.getrgb(PURSUER)
        x, y = state[4:6]
        assert colour_at(picture, x, y) == ImageColor.getrgb(PAPER)
        assert colour_at(picture, x + 0.11, y) == colour_at(picture, x - 0.11, y) == ImageColor.getrgb(EVADER)
    assert colour_at(pictures[0], 3, 5) == (255, 255, 255)
    red, green, blue = colour_at(pictures[-1], 3, 5)
    assert red > green + 40
    assert red > blue + 40


def test_trails_differ_by_their_dashes(replay):
    last = next(frames(replay, [STEPS]))
    drawn = [
        np.mean([colour_at(last, *place) != (255, 255, 255) for place in places])
        for places in (
            [(2 + part, 5) for part in np.linspace(0.1, 1.5)],
            [(8, 6 + part) for part in np.linspace(0.1, 1.5)],
        )
    ]
    assert drawn[0] == 1
    assert 0.3 < drawn[1] < 0.7


def test_the_reach_of_a_capture_is_around_the_pursuer(replay):
    """Half of the circle is dots."""
    far = replace(replay.game, capture_distance=1.0)
    picture = next(frames(replace(replay, game=far)))
    around = [colour_at(picture, 2 + 1.0 * np.cos(a), 5 + 1.0 * np.sin(a)) for a in np.arange(0.05, 6.3, 0.01)]
    assert 0.3 < np.mean([colour != (255, 255, 255) for colour in around]) < 0.7


def test_a_frame_says_who_plays_the_time_the_distance_and_at_the_end_the_outcome(replay, monkeypatch):
    first = words_of(monkeypatch, replay, 0)
    assert {"pursuer P", "evader E", "capture within 0.3 m", "1 m", "0.0 s"} <= set(first)
    assert f"distance {np.hypot(6, 1):.2f} m" in first
    assert "0.5 s, 2 x real time" in words_of(monkeypatch, replay, 5, speed=2.0)
    assert "no result after 1.2 s" in words_of(monkeypatch, replay, STEPS)


def test_long_names_are_cut_where_the_legend_begins(replay, monkeypatch):
    said = words_of(monkeypatch, replace(replay, pursuer="shielded:" + "long-" * 30), 0)
    (name,) = (word for word in said if word.startswith("pursuer"))
    assert name.startswith("pursuer shielded:long-")
    assert name.endswith("...")
    assert len(name) < 60


def test_a_picture_renewed_in_parts_is_that_of_the_whole(replay):
    """Also where robots stand close together, at a wall, and beyond it."""
    canvas, states = Canvas(replay.game), replay.states.copy()
    states[4:8, 4:6] = states[4:8, :2] + 0.05
    states[8:, 0] = np.linspace(9.5, 10.5, STEPS - 7)
    for state in states.tolist():
        canvas.move(state)
        whole = canvas._trails.copy()
        canvas._draw_robots(ImageDraw.Draw(whole))
        np.testing.assert_array_equal(np.asarray(canvas.picture()), np.asarray(whole.reduce(2)))


def durations(path):
    with Image.open(path) as picture:
        found = []
        for frame in range(picture.n_frames):
            picture.seek(frame)
            picture.load()
            found.append(picture.info["duration"])
        return found, picture.convert("RGB")


@pytest.mark.parametrize("name", ["game.gif", "game.webp"])
def test_an_animation_has_every_frame_in_real_time(replay, tmp_path, name):
    save_animation(replay, tmp_path / "new" / name)
    shown, last = durations(tmp_path / "new" / name)
    assert last.size == (SIZE + 2 * MARGIN, SIZE + 3 * LINE + 2 * MARGIN)
    assert shown[:-1] == [100] * STEPS
    assert shown[-1] == 2000
    assert np.linalg.norm(np.subtract(colour_at(last, 4, 5), ImageColor.getrgb(PURSUER))) < 40


@pytest.mark.parametrize(
    ("speed", "count", "seconds"), [(0.5, 13, 2.4), (3.0, 13, 0.4), (10.0, 7, 0.12), (100.0, 2, 0.02)]
)
def test_at_another_speed_an_animation_takes_as_long_as_it_should(replay, tmp_path, speed, count, seconds):
    """Steps are left out where browsers would refuse to show them so quickly; the last one is there."""
    save_animation(replay, tmp_path / "game.gif", speed)
    shown, last = durations(tmp_path / "game.gif")
    assert len(shown) == count
    assert min(shown) >= 20
    assert sum(shown[:-1]) == pytest.approx(1000 * seconds, abs=10)
    assert np.linalg.norm(np.subtract(colour_at(last, 4, 5), ImageColor.getrgb(PURSUER))) < 40


@pytest.mark.parametrize(("speed", "per_second"), [(1.0, 10), (4.0, 40)])
def test_an_mp4_has_every_frame_and_stays_at_the_end(replay, tmp_path, speed, per_second):
    save_animation(replay, tmp_path / "game.mp4", speed)
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "game.mp4"))
    assert count == STEPS + 1 + 2 * per_second
    assert seconds == pytest.approx(count / per_second, abs=0.11)


@pytest.mark.parametrize(("x_max", "y_max", "size"), [(20.0, 10.0, (480, 240)), (10.0, 20.3, (236, 480))])
def test_an_arena_that_is_no_square_keeps_its_shape_and_the_words_their_room(replay, x_max, y_max, size):
    arena = replace(replay.game.arena, x_max=x_max, y_max=y_max)
    wide = replace(replay, game=replace(replay.game, arena=arena))
    assert Canvas(wide.game).picture().size == size
    picture = next(frames(wide))
    assert picture.width == max(size[0], 400) + 2 * MARGIN
    assert all(side % 2 == 0 for side in picture.size)
    column, _ = Captioned(wide).corner
    assert column == (picture.width - size[0]) // 2


@pytest.mark.parametrize(
    ("name", "speed", "naming"),
    [
        ("game.avi", 1.0, r"game\.avi .*\.gif, \.webp, \.mp4"),
        ("game.gif", 0.0, "speed = 0.0 .* 0.05 to 100"),
        ("game.gif", float("nan"), "speed = nan"),
        ("game.gif", float("inf"), "speed = inf"),
    ],
)
def test_what_cannot_be_animated_is_refused(replay, tmp_path, name, speed, naming):
    with pytest.raises(InvalidInput, match=naming):
        save_animation(replay, tmp_path / name, speed)
    assert not list(tmp_path.iterdir())


def save_panel(path):
    with style.picture(path):
        pass


@pytest.mark.parametrize("name", ["g.gif", "g.webp", "g.mp4", "g.png", "panel.png", "gallery.png"])
def test_a_full_disk_spares_the_old_file(replay, tmp_path, name):
    """No file may grow beyond a kilobyte, so that every writer fails in the middle."""
    resource = pytest.importorskip("resource")
    write = {
        "g.png": lambda path: save_picture(replay, path),
        "panel.png": save_panel,
        "gallery.png": lambda path: save_gallery({"paper": replay.game}, path),
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


def test_where_nothing_moves_a_second_is_one_frame(replay, tmp_path):
    steps = 50
    states, actions = replay.states[:1].repeat(steps + 1, axis=0), replay.actions[:1].repeat(steps, axis=0)
    still = replace(replay, states=states, actions=actions)
    save_animation(still, tmp_path / "still.gif")
    with Image.open(tmp_path / "still.gif") as picture:
        frames_shown = picture.n_frames
        durations = []
        for number in range(frames_shown):
            picture.seek(number)
            durations.append(picture.info["duration"])
    assert frames_shown == 6
    assert durations == [1000] * 5 + [2000]
