"""What an interface shows: pictures, without a display."""

import numpy as np
import pytest

import apollonius
from apollonius.adapters.gymnasium import OneSide
from apollonius.adapters.live import LiveGame, View
from apollonius.errors import InvalidInput
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.show.palette import EVADER, PURSUER

WIDE = Game(arena=Arena(-2.0, 6.0, 1.0, 5.0))


class Standing(LiveGame):
    """A game whose robots stand where they are put."""

    robots = active = None  # not read from what a step told

    def __init__(self, *robots):
        self.game, self.robots = WIDE, robots


def pixels_of(picture, colour):
    """Rows and columns of a colour."""
    wanted = [int(colour[start : start + 2], 16) for start in (1, 3, 5)]
    return np.argwhere((np.abs(picture.astype(int) - wanted) < 12).all(axis=-1))


def test_the_picture_shows_the_robots_where_they_are_and_the_trails_behind_them():
    live = Standing(0.0, 2.0, 0.0, 0.0, 5.0, 4.5, 0.0, 0.0)
    view = View(live, "rgb_array")
    assert len(pixels_of(view.render(), PURSUER)) == 0
    view.begin()
    before = view.render()
    assert before.shape == (240, 480, 3)
    row, column = pixels_of(before, PURSUER).mean(axis=0)
    assert abs(column / 60 - 2 - 0.0) < 0.1
    assert abs(5 - row / 60 - 2.0) < 0.1
    live.robots = (3.0, 2.0, 0.0, 0.0, 5.0, 4.5, 0.0, 0.0)
    view.follow()
    after = view.render()
    assert len(pixels_of(after, PURSUER)) > len(pixels_of(before, PURSUER)) + 150
    assert len(pixels_of(after, EVADER)) == len(pixels_of(before, EVADER))
    view.begin()
    assert len(pixels_of(view.render(), PURSUER)) < len(pixels_of(after, PURSUER)) - 150


def test_without_a_mode_there_is_no_picture_and_other_modes_are_refused():
    silent = apollonius.parallel_env()
    silent.reset(seed=0)
    assert silent.render() is None
    with pytest.raises(InvalidInput, match=r"render_mode = human .* rgb_array"):
        OneSide(Role.PURSUER, opponent="still", render_mode="human")
