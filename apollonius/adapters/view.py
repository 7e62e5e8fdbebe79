"""What an interface shows of its game: pictures, or the terminal. Neither needs a display."""

import sys
import time

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from apollonius.adapters.live import LiveGame
from apollonius.errors import require
from apollonius.show.canvas import Canvas

RENDER_MODES = ["human", "rgb_array"]
"""`human`: every step is drawn in the terminal, in real time; `rgb_array`: `render` returns a picture."""
_COLUMNS = 72
"""Width of a drawing in the terminal [letters]."""
_UPPER_HALF = "\u2580"


class View:
    """The game of an interface, shown in one of the render modes, or not at all.

    Raises:
        InvalidInput: for an unknown render mode.
    """

    def __init__(self, live: LiveGame, mode: str | None) -> None:
        require(mode in (None, *RENDER_MODES), "render_mode", mode, f"one of {', '.join(RENDER_MODES)}, or None")
        self.mode = mode
        self._live = live
        self._canvas = Canvas(live.game) if mode else None
        self._due = 0.0

    def begin(self) -> None:
        if self._canvas:
            self._canvas.wipe()
            self.follow()

    def follow(self) -> None:
        if self._canvas:
            self._canvas.move(self._live.robots, self._live.active)
            if self.mode == "human":
                self._print(self._canvas)

    def render(self) -> UInt8[np.ndarray, "height width 3"] | None:
        """The picture, in mode `rgb_array`; otherwise None, as `human` is drawn anyway and no mode means no picture."""
        return np.array(self._canvas.picture()) if self._canvas and self.mode == "rgb_array" else None

    def _print(self, canvas: Canvas) -> None:
        """Draw over the last drawing, when its time has come; in a pipe or a log, at once and one below another."""
        terminal = sys.stdout.isatty()
        if terminal:
            time.sleep(max(0.0, self._due - time.monotonic()))
            self._due = time.monotonic() + float(self._live.game.dt)
        home = "\x1b[2J\x1b[H" if terminal else ""
        print(f"{home}{in_letters(canvas.picture())}\n{self._live.outcome.replace('_', ' ')}", flush=True)


def in_letters(picture: Image.Image, columns: int = _COLUMNS) -> str:
    """A picture as lines of text, for a terminal with colours: each letter is one pixel above another."""
    rows = max(1, round(columns * picture.height / picture.width / 2))
    pixels = np.asarray(picture.resize((columns, 2 * rows), Image.Resampling.BOX)).tolist()

    def letter(upper: list[int], lower: list[int]) -> str:
        (r, g, b), (low_r, low_g, low_b) = upper, lower
        return f"\x1b[38;2;{r};{g};{b};48;2;{low_r};{low_g};{low_b}m{_UPPER_HALF}"

    lines = [map(letter, pixels[2 * row], pixels[2 * row + 1]) for row in range(rows)]
    return "\n".join("".join(line) + "\x1b[0m" for line in lines)
