"""A game as a moving picture: GIF or WebP, or MP4 with the `video` extra. Needs no display."""

import warnings
from collections.abc import Iterator
from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageColor, ImageDraw

from apollonius.errors import InvalidInput, require
from apollonius.replay import Replay
from apollonius.show.palette import EVADER, INK, OBSTACLE, PAPER, PURSUER

FORMATS = (".gif", ".webp", ".mp4")
SIZE = 480
"""Pixels of the picture's longer side."""
_FINER = 2
"""Pixels are drawn this many times finer, then averaged."""
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
    """A picture for every state of a game, from above: walls, discs, both trails, both robots and their headings."""
    arena, states = replay.game.arena, replay.states.tolist()
    width, height = float(arena.x_max - arena.x_min), float(arena.y_max - arena.y_min)
    scale = SIZE * _FINER / max(width, height)
    canvas = Image.new("RGB", (round(width * scale), round(height * scale)), PAPER)

    def pixel(x: float, y: float) -> tuple[float, float]:
        return (x - float(arena.x_min)) * scale, (float(arena.y_max) - y) * scale

    def disc(draw: ImageDraw.ImageDraw, x: float, y: float, radius: float, colour: str) -> None:
        column, row = pixel(x, y)
        reach = radius * scale
        draw.ellipse((column - reach, row - reach, column + reach, row + reach), fill=colour)

    draw = ImageDraw.Draw(canvas)
    for obstacle in arena.discs:
        disc(draw, float(obstacle.x), float(obstacle.y), float(obstacle.radius), OBSTACLE)
    draw.rectangle((0, 0, canvas.width - 1, canvas.height - 1), outline=INK, width=2 * _FINER)
    robots = (
        ([state[:4] for state in states], PURSUER, float(replay.game.pursuer.radius)),
        ([state[4:] for state in states], EVADER, float(replay.game.evader.radius)),
    )
    for step in range(len(states)):
        if step:
            for path, colour, _ in robots:  # trails stay, so each frame adds only its own piece
                ends = [pixel(*state[:2]) for state in path[step - 1 : step + 1]]
                draw.line(ends, fill=colour, width=2 * _FINER, joint="curve")
        picture = canvas.copy()
        over = ImageDraw.Draw(picture)
        for path, colour, body in robots:
            x, y, _, heading = path[step]
            size = max(body, 0.012 * max(width, height))
            disc(over, x, y, size, colour)
            nose = pixel(x + 2 * size * cos(heading), y + 2 * size * sin(heading))
            over.line([pixel(x, y), nose], fill=colour, width=3 * _FINER)
        yield picture.reduce(_FINER)


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
