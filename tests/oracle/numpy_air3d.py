"""Two cars seen from one of them, in float64: the game of Mitchell, Bayen and Tomlin (2005), semi-Lagrangian.

The evader is at the origin and looks along x; the pursuer is at (x, y) with heading psi. Speeds are constant. The value
is the least distance to which the evader can keep the pursuer over a horizon, less the capture distance:

    V(z) = min( |(x, y)| - capture,  max over the evader's turns of min over the pursuer's of V(where they lead) ).

Captures are certain where V < 0. V is continuous across that set's barrier, unlike a time or a win, so that
interpolation hardly moves it.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from tests.oracle.numpy_game import LEVELS, move


@dataclass(frozen=True)
class Cars:
    """The speeds [m/s], the largest turn rate of both [rad/s] and the capture distance [m]."""

    pursuer: float
    evader: float
    turn: float
    capture: float


def least_distance(cars, size, places, headings, seconds):
    """V by psi, x and y: psi at `headings` nodes from 0 on, x and y at `places` nodes each from -size to size.

    In a step a car turns by one cell of headings at most, so that only x and y are interpolated.
    """
    dt = math.tau / headings / cars.turn
    axis = np.linspace(-size, size, places)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    beyond = np.hypot(x, y) - cars.capture
    values = np.broadcast_to(beyond, (headings, places, places))
    for _ in range(round(seconds / dt)):
        after = np.empty_like(values)
        for number in range(headings):
            psi = math.tau * number / headings
            answered = []
            for evading in LEVELS:
                action_values = []
                for pursuing in LEVELS:
                    seen = moved(cars, (x, y, psi), pursuing, evading, dt)
                    cells = [(place + size) * (places - 1) / (2 * size) for place in seen]
                    table = values[(number + pursuing - evading) % headings]
                    action_values.append(map_coordinates(table, cells, order=1, mode="nearest"))
                answered.append(np.min(action_values, axis=0))
            after[number] = np.minimum(beyond, np.max(answered, axis=0))
        values = after
    return values


def moved(cars, state, pursuing, evading, dt):
    """Where the evader sees the pursuer after both have driven an arc."""
    x, y, psi = state
    x, y, *_ = move(None, (x, y, cars.pursuer, psi), (0, pursuing * cars.turn), dt)
    own_x, own_y, _, turned = move(None, (0.0, 0.0, cars.evader, 0.0), (0, evading * cars.turn), dt)
    cos, sin = math.cos(turned), math.sin(turned)
    return cos * (x - own_x) + sin * (y - own_y), cos * (y - own_y) - sin * (x - own_x)
