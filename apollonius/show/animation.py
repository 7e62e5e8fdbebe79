"""A game as a moving picture: GIF or WebP, or MP4 with the `video` extra. Needs no display."""

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageColor

from apollonius.errors import InvalidInput, require
from apollonius.replay import Replay
from apollonius.show.canvas import Canvas
from apollonius.show.palette import EVADER, INK, OBSTACLE, PAPER, PURSUER

FORMATS = (".gif", ".webp", ".mp4")
_LAST_SECONDS = 1.5
"""How long the end is shown."""


def save_animation(replay: Replay, path: Path) -> None:
    """Write a game in real time, or as near to it as the format allows.

    Raises:
        InvalidInput: for another ending than `FORMATS`, and for MP4 where `imageio-ffmpeg` is not installed.
    """
    require(path.suffix in FORMATS, "--out", path, f"a file that ends in one of {', '.join(FORMATS)}")
    path.parent.mkdir(parents=True, exist_ok=True)
    step_ms = round(1000 * float(replay.game.dt))
    pictures = list(frames(replay))
    if path.suffix == ".mp4":
        _save_mp4(pictures, path, round(1000 / step_ms))
        return
    durations = [step_ms] * (len(pictures) - 1) + [round(1000 * _LAST_SECONDS)]
    if path.suffix == ".gif":
        palette = _palette()
        pictures = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    options: dict[str, Any] = {"optimize": False} if path.suffix == ".gif" else {"method": 0, "quality": 80}
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=durations, loop=0, **options)


def frames(replay: Replay) -> Iterator[Image.Image]:
    """A picture for every state of a game."""
    canvas = Canvas(replay.game)
    for state in replay.states.tolist():
        canvas.move(state)
        yield canvas.picture()


def _palette() -> Image.Image:
    """The colours of all frames: each of the picture's own, and its blends with the paper and the obstacles."""
    own = [ImageColor.getrgb(colour) for colour in (PURSUER, EVADER, OBSTACLE, INK, PAPER)]
    colours = [
        tuple(round(a + (b - a) * part / 8) for a, b in zip(first, second, strict=True))
        for index, first in enumerate(own)
        for second in own[index + 1 :]
        for part in range(9)
    ]
    palette = Image.new("P", (1, 1))
    palette.putpalette([channel for colour in colours for channel in colour])
    return palette


def _save_mp4(pictures: list[Image.Image], path: Path, per_second: int) -> None:
    try:
        import imageio_ffmpeg
    except ModuleNotFoundError as error:
        raise InvalidInput("MP4 needs imageio-ffmpeg: pip install 'apollonius[video]', or use .gif.") from error
    size = pictures[0].size
    # H.264 halves the resolution of colours: both sides must be even.
    even = (size[0] // 2 * 2, size[1] // 2 * 2)
    writer = imageio_ffmpeg.write_frames(
        str(path), even, fps=per_second, macro_block_size=2, ffmpeg_log_level="error",
        output_params=["-preset", "veryfast"],
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # JAX fears a fork, but this one becomes ffmpeg at once
        writer.send(None)
    for picture in [*pictures, *pictures[-1:] * round(_LAST_SECONDS * per_second)]:
        writer.send(np.ascontiguousarray(picture.crop((0, 0, *even))))
    writer.close()
