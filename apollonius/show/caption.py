"""A game under way with words around it: who plays, how far apart they are, the time, how it ended."""

from collections.abc import Sequence
from math import floor, log10

from PIL import Image, ImageDraw, ImageFont

from apollonius.game.types import Role
from apollonius.replay import Replay
from apollonius.show.canvas import Canvas, draw_reach, draw_robot
from apollonius.show.palette import EVADER, INK, PAPER, PURSUER
from apollonius.show.robots import in_play, side_name
from apollonius.show.words import describe_end, describe_play

LETTERS = 14
"""Height of a line's letters [pixels]."""
LINE = 22
"""Height of a line [pixels]."""
MARGIN = 8
"""Pixels around everything."""
LEAST_WIDTH = 400
"""Pixels that the words need, where the arena is narrow."""
_SIGN = 12
"""Size of a sign in the legend [pixels]."""
_SCALE = 80
"""Greatest length of the scale [pixels]."""


class Captioned:
    """A replay's game as it goes on: above the arena names and legend, below it the clock, at the end the outcome.

    Args:
        replay: the game.
        speed: seconds of the game in one, which is said where it is not 1.
    """

    def __init__(self, replay: Replay, speed: float = 1.0) -> None:
        self._replay, self._canvas = replay, Canvas(replay.game)
        self._font = ImageFont.load_default(LETTERS)
        self._pace = "" if speed == 1 else f", {speed:g} x real time"
        arena = self._canvas.picture()
        width = max(arena.width, LEAST_WIDTH) + 2 * MARGIN
        height = 2 * LINE + arena.height + LINE + 2 * MARGIN
        # Videos store colours for two by two pixels: both sides must be even.
        self._page = Image.new("RGB", (width + width % 2, height + height % 2), PAPER)
        self.corner = ((width - arena.width) // 2, MARGIN + 2 * LINE)
        """Column and row of the arena's upper left corner."""
        self._below = self.corner[1] + arena.height + LINE // 2 + MARGIN // 2
        self._in_play = in_play(replay.game, replay)
        self._here: Sequence[float] = ()
        self._head(ImageDraw.Draw(self._page))

    def move(self, step: int) -> None:
        """The robots are where they are after so many steps; all steps are gone through in their order."""
        self._here, self._step = self._replay.states[step].tolist(), step
        self._canvas.move(self._here, self._in_play[step].tolist())

    def picture(self) -> Image.Image:
        """The picture of where the robots are."""
        page, step = self._page.copy(), self._step
        page.paste(self._canvas.picture(), self.corner)
        draw = ImageDraw.Draw(page)
        clock = f"{step * float(self._replay.game.dt):.1f} s"
        if step == len(self._replay.actions):
            clock = describe_end(self._replay.game, self._replay)
        self._write(draw, MARGIN, self._below, f"{clock}{self._pace}", INK)
        now = describe_play(self._replay.game, self._here, self._in_play[step].tolist())
        self._write(draw, page.width - MARGIN, self._below, now, INK, "rm")
        return page

    def _head(self, draw: ImageDraw.ImageDraw) -> None:
        """The signs of both robots with their players' names, the reach of a capture, and a scale."""
        right = self._page.width - MARGIN
        first, second = (MARGIN + LINE // 2 + LINE * line for line in range(2))
        reach = f"capture within {float(self._replay.game.capture_distance):g} m"
        self._write(draw, right, first, reach, PURSUER, "rm")
        left = right - self._font.getlength(reach) - 6 - _SIGN
        draw_reach(draw, (left + _SIGN / 2, float(first)), _SIGN / 2, 1)
        metres = _round_below(_SCALE / self._canvas.scale)
        self._write(draw, right, second, f"{metres:g} m", INK, "rm")
        end = right - self._font.getlength(f"{metres:g} m") - 6
        start = end - metres * self._canvas.scale
        draw.line([(start, second), (end, second)], fill=INK, width=2)
        for column in (start, end):
            draw.line([(column, second - 4), (column, second + 4)], fill=INK, width=2)
        names, colours = (self._replay.pursuer, self._replay.evader), (PURSUER, EVADER)
        for role, name, colour, row, end in zip(Role, names, colours, (first, second), (left, start), strict=True):
            draw_robot(draw, (MARGIN + _SIGN / 2, float(row)), _SIGN / 2, role)
            begins, side = MARGIN + _SIGN + 6, side_name(self._replay.game, role)
            self._write(draw, begins, row, self._fit(f"{side} {name}", end - begins - MARGIN), colour)

    def _write(
        self,
        draw: ImageDraw.ImageDraw,
        column: float | int,
        row: float | int,
        text: str,
        colour: str,
        anchor: str = "lm",
    ) -> None:
        draw.text((column, row), text, fill=colour, font=self._font, anchor=anchor)

    def _fit(self, text: str, width: float | int) -> str:
        """As much of a text as fits into so many pixels."""
        if self._font.getlength(text) <= width:
            return text
        while text and self._font.getlength(f"{text}...") > width:
            text = text[:-1]
        return f"{text}..."


def _round_below(length: float) -> float:
    """The greatest of 1, 2, 5, 10, 20, ... and their tenths that is no more than a length."""
    power = 10.0 ** floor(log10(length))
    return max(part * power for part in (1, 2, 5) if part * power <= length)
