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
