"""What an interface shows: pictures without a display, drawings in the terminal."""

import re

import numpy as np
from PIL import Image

import apollonius
from apollonius.envs.gymnasium import OneSide
from apollonius.envs.live import LiveGame, View, in_letters
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.show.palette import EVADER, PURSUER

WIDE = Game(arena=Arena(-2.0, 6.0, 1.0, 5.0))


class Standing(LiveGame):
    """A game whose robots stand where they are put."""

    robots, active = None, (True, True)  # not read from what a step returned

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


def test_in_letters_each_letter_is_two_pixels_of_the_picture():
    picture = Image.new("RGB", (40, 20), (255, 255, 255))
    picture.paste((200, 10, 30), (20, 0, 40, 10))
    lines = in_letters(picture, columns=4).splitlines()
    assert len(lines) == 1
    colours = re.findall(r"38;2;(\d+);(\d+);(\d+);48;2;(\d+);(\d+);(\d+)m.", lines[0])
    white, red = ("255",) * 3, ("200", "10", "30")
    assert colours == [white + white, white + white, red + white, red + white]


def test_a_person_sees_every_step_and_nobody_else_anything(capsys):
    env = OneSide(Role.PURSUER, opponent="still", render_mode="human")
    env.reset(seed=0)
    env.step(4)
    assert env.render() is None
    assert capsys.readouterr().out.count("ongoing") == 2
    silent = apollonius.parallel_env()
    silent.reset(seed=0)
    assert silent.render() is None
    assert capsys.readouterr().out == ""
