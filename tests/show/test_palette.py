"""The colours can be told apart and read: by WCAG's contrast, and as colour-blind readers see them."""

import numpy as np
import pytest
from PIL import ImageColor

from apollonius.show.palette import DARK, LIGHT

THEMES = pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])

SEEN_BY = {
    "everyone": np.eye(3),
    "protanopes": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopes": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopes": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""Linear RGB as it looks to each (Machado, Oliveira, Fernandes, "A physiologically-based model for simulation of color
vision deficiency", 2009, severity 1)."""

XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def linear(colour):
    """Linear RGB of a colour (IEC 61966-2-1)."""
    c = np.array(ImageColor.getrgb(colour)) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def contrast(first, second):
    """WCAG 2's contrast of two colours."""
    low, high = sorted(float(XYZ[1] @ linear(colour)) for colour in (first, second))
    return (high + 0.05) / (low + 0.05)


def lab(rgb):
    """CIELAB of linear RGB."""
    ratio = XYZ @ np.clip(rgb, 0, 1) / XYZ.sum(axis=1)
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def test_contrast_is_wcags():
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
    assert contrast("#767676", "#ffffff") == pytest.approx(4.54, abs=0.01)


@THEMES
@pytest.mark.parametrize("ground", ["paper", "panel"])
@pytest.mark.parametrize("name", ["ink", "quiet", "pursuer", "evader"])
def test_words_can_be_read(theme, ground, name):
    assert contrast(theme[name], theme[ground]) >= 4.5


@THEMES
@pytest.mark.parametrize("name", ["obstacle", "other"])
def test_shapes_can_be_seen(theme, name):
    assert contrast(theme[name], theme["paper"]) >= 3


@THEMES
@pytest.mark.parametrize("eyes", SEEN_BY)
def test_pursuer_evader_and_the_third_colour_can_be_told_apart(theme, eyes):
    """A difference of 20 is far beyond the 2.3 that can just be noticed."""
    seen = [lab(SEEN_BY[eyes] @ linear(theme[name])) for name in ("pursuer", "evader", "other")]
    for first, second in ((0, 1), (0, 2), (1, 2)):
        assert np.linalg.norm(seen[first] - seen[second]) >= 20
