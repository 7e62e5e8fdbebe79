"""Frames of animations: their colours and words."""

import pytest
from PIL import ImageColor, ImageDraw

from apollonius.show.animation import LINE, MARGIN, frames
from apollonius.show.canvas import SIZE
from apollonius.show.palette import EVADER, PAPER, PURSUER

RED, BLUE, WHITE = map(ImageColor.getrgb, (PURSUER, EVADER, PAPER))


def colour_at(picture, x, y):
    return picture.getpixel((MARGIN + round(x / 10 * SIZE), MARGIN + 2 * LINE + round((10 - y) / 10 * SIZE)))


@pytest.fixture
def words_of(monkeypatch):
    """A function that returns the texts of some frames."""
    said, write = [], ImageDraw.ImageDraw.text

    def listen(self, point, text, *arguments, **options):
        said.append(text)
        write(self, point, text, *arguments, **options)

    monkeypatch.setattr(ImageDraw.ImageDraw, "text", listen)
    return lambda *given: (said.clear(), list(frames(*given)), [*said])[-1]
