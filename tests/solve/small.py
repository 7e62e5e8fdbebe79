"""A small game that a grid covers at once: a slow robot, 3 m by 4 m, one disc."""

from dataclasses import replace

import numpy as np

from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.starts import Starts

BODY = Unicycle(v_max=0.6, radius=0.05)
SMALL = Game(
    pursuer=BODY,
    evader=BODY,
    arena=Arena(x_min=-1.0, x_max=2.0, y_max=4.0, discs=(Disc(0.7, 2.2, 0.4),)),
    starts=Starts(clearance=0.1, separation=0.5),
)
MOVING = replace(SMALL, starts=replace(SMALL.starts, speed="moving"))
CRAMPED = Game(pursuer=BODY, evader=BODY, arena=Arena(x_max=1.6, y_max=1.2), capture_distance=0.25, starts=SMALL.starts)
"""So small that a grid of few nodes has captures, escapes and crashes."""
FEW = (4, 3, 2, 5)
"""Nodes of either robot there."""
FEWER = (4, 3, 2, 4)
"""Few enough for plain loops over pairs of nodes and of actions."""
HOLD = 5
"""Steps for which actions are held there."""
TINY = (5, 6, 3, 7)
"""Nodes along x, y, v and heading: few enough for plain loops."""


def as_matrix(table):
    """The table of two robots by the nodes of the one that moves, and of the one that waits."""
    return np.swapaxes(np.asarray(table), 0, 1).reshape(table.shape[1], -1)
