"""A game as a moving picture: as many frames as states, in the robots' colours, where they are."""

from dataclasses import replace

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image, ImageColor

from apollonius.errors import InvalidInput
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome
from apollonius.replay import Replay
from apollonius.show.animation import frames, save_animation
from apollonius.show.canvas import SIZE
from apollonius.show.palette import EVADER, PURSUER

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


def colour_at(picture, x, y):
    return picture.getpixel((round(x / 10 * SIZE), round((10 - y) / 10 * SIZE)))


def test_every_state_is_a_frame_with_both_robots_where_they_are(replay):
    pictures = list(frames(replay))
    assert len(pictures) == STEPS + 1
    for picture, state in zip(pictures, replay.states, strict=True):
        assert colour_at(picture, *state[:2]) == ImageColor.getrgb(PURSUER)
        assert colour_at(picture, *state[4:6]) == ImageColor.getrgb(EVADER)
    assert colour_at(pictures[0], 3, 5) == (255, 255, 255)
    red, green, blue = colour_at(pictures[-1], 3, 5)
    assert red > green + 40
    assert red > blue + 40


@pytest.mark.parametrize("name", ["game.gif", "game.webp"])
def test_an_animation_has_every_frame_in_real_time(replay, tmp_path, name):
    save_animation(replay, tmp_path / "new" / name)
    with Image.open(tmp_path / "new" / name) as picture:
        assert picture.n_frames == STEPS + 1
        assert picture.size == (SIZE, SIZE)
        picture.load()
        assert picture.info["duration"] == 100
        picture.seek(STEPS)
        assert np.linalg.norm(np.subtract(colour_at(picture.convert("RGB"), 4, 5), ImageColor.getrgb(PURSUER))) < 40


def test_an_mp4_has_every_frame_and_stays_at_the_end(replay, tmp_path):
    save_animation(replay, tmp_path / "game.mp4")
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "game.mp4"))
    assert count == STEPS + 1 + 15
    assert seconds == pytest.approx(count / 10, abs=0.11)


def test_an_arena_that_is_no_square_keeps_its_shape(replay):
    arena = replace(replay.game.arena, x_max=20.0)
    picture = next(frames(replace(replay, game=replace(replay.game, arena=arena))))
    assert picture.size == (SIZE, SIZE // 2)


def test_another_format_is_refused(replay, tmp_path):
    with pytest.raises(InvalidInput, match=r"game\.avi .*\.gif, \.webp, \.mp4"):
        save_animation(replay, tmp_path / "game.avi")
    assert not list(tmp_path.iterdir())
