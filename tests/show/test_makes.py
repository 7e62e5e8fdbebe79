"""Who wins where, as a picture: a panel for each radius, a number in each cell, a line, and the game's own robots."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from apollonius.evaluate.makes import Make, MakeTable
from apollonius.evaluate.match import MatchResult
from apollonius.evaluate.statistics import wilson_interval
from apollonius.show import palette
from apollonius.show.makes import _legible, _place, draw_makes, draw_radius, parting
from tests.show.test_palette import contrast

GAMES = 200


def a_match(won):
    """A match of which nothing counts but the pursuer's wins."""
    interval = wilson_interval(won, GAMES)
    return MatchResult(GAMES, {}, won / GAMES, interval, 0.0, (0.0, 0.0), 1 - won / GAMES, 1.0, None, 0.0)


def a_table(own):
    """Three speeds, two turn rates, two radii."""
    part = ((a_match(20), a_match(90), a_match(180)), (a_match(40), a_match(110), a_match(200)))
    return MakeTable("P", "E", (0.8, 1.0, 1.5), (1.0, 2.0), (0.0, 0.1), (0.3, 0.5), (part, part), own, a_match(33))


def test_a_cell_has_its_share_and_interval_and_a_line_parts_the_sides():
    axes = Figure().subplots()
    mesh = draw_radius(axes, a_table(Make(1.0, 1.0, 0.1)), 0)
    assert [text.get_text() for text in axes.texts][::2] == ["10", "45", "90", "20", "55", "100"]
    low, high = wilson_interval(20, GAMES)
    assert axes.texts[1].get_text() == f"{100 * low:.0f} to {100 * high:.0f}"
    np.testing.assert_allclose(mesh.get_array(), [[10, 45, 90], [20, 55, 100]])
    assert [label.get_text() for label in axes.get_xticklabels()] == ["0.8", "1", "1.5"]
    assert "radius 0 m, caught within 0.3 m" in {axes.get_title(loc=where) for where in ("left", "center")}
    (border,) = (drawn for drawn in axes.collections if isinstance(drawn, LineCollection))
    ends = {tuple(map(tuple, segment)) for segment in border.get_segments()}
    assert ends == {((2, 0), (2, 1)), ((1, 1), (1, 2)), ((1, 1), (2, 1))}
    assert not axes.lines  # the game's own robots have another radius


@pytest.mark.parametrize(
    ("own", "places"),
    [
        (Make(1.0, 2.0, 0.1), [None, (1.86, 1.82)]),
        (Make(1.25, 1.0, 0.0), [(2.0, 0.5), None]),
        (Make(3.0, 1.0, 0.0), [None, None]),
        (Make(1.0, 1.0, None), [None, None]),
    ],
    ids=str,
)
def test_the_games_own_robots_are_marked_where_they_lie(own, places):
    found = [_place(a_table(own), index) for index in range(2)]
    assert [place and pytest.approx(place) for place in places] == found


def test_what_all_cells_have_in_common_has_no_line():
    assert parting(np.ones((2, 3), bool)) == []


def test_numbers_can_be_read_on_every_colour():
    for grey in np.linspace(0, 1, 21):
        chosen = _legible((grey, grey, grey, 1.0))
        other = palette.INK if chosen == palette.PAPER else palette.PAPER
        ground = "#" + 3 * f"{round(255 * grey):02x}"
        assert contrast(chosen, ground) >= contrast(other, ground) - 0.05


@pytest.mark.parametrize("own", [Make(1.0, 1.0, 0.1), Make(3.0, 1.0, None)], ids=str)
def test_the_picture_is_saved(tmp_path, own):
    two = a_table(own)
    distances = (0.3, 0.5, 0.7, 0.9)
    four = replace(two, radii=(0.0, 0.1, 0.2, 0.3), capture_distances=distances, matches=two.matches * 2)
    draw_makes(four, tmp_path / "all.png")
    assert (tmp_path / "all.png").read_bytes().startswith(b"\x89PNG")
