"""The homicidal chauffeur (Isaacs, 1965; Merz, 1971) in the chauffeur's frame, in float64, semi-Lagrangian.

The pursuer is at the origin and looks along x: it drives at constant speed on circles no smaller than one radius. The
evader at (x, y) is slower and moves in any direction at once. The value is the least distance to which the evader can
keep the pursuer over a horizon:

    V(z) = min( |z|,  max over the evader's directions of min over the pursuer's turns of V(where they lead) ).

Captures at a distance l are certain where V < l. In the long run V is nowhere more than `evadable_distance`: captures
are certain from everywhere iff l is larger.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

DIRECTIONS = 16
"""Directions of the evader in a step."""


@dataclass(frozen=True)
class Chauffeur:
    """The speeds [m/s] and the radius of the pursuer's smallest circle [m]."""

    pursuer: float
    evader: float
    radius: float


def evadable_distance(game):
    """Return the largest distance that the evader can keep for ever, from where it is well placed (Isaacs)."""
    ratio = game.evader / game.pursuer
    return game.radius * (math.sqrt(1 - ratio**2) + ratio * math.asin(ratio) - 1)


def least_distance(game, size, places, seconds, steps):
    """Return V by x and y, at `places` nodes each from -size to size, after `steps` steps in all.

    An evader who is farther away than that is taken to be at the edge.
    """
    axis = np.linspace(-size, size, places)
    now = np.stack(np.meshgrid(axis, axis, indexing="ij")).reshape(2, -1)
    moves = [
        [weights(seen(game, now, direction, turning, seconds / steps), size, places) for turning in (-1, 0, 1)]
        for direction in math.tau / DIRECTIONS * np.arange(DIRECTIONS)
    ]
    distance = np.hypot(*now)
    values = distance
    for _ in range(steps):
        answered = [np.min([move @ values for move in by_turn], axis=0) for by_turn in moves]
        values = np.minimum(distance, np.max(answered, axis=0))
    return values.reshape(places, places)


def seen(game, place, direction, turning, dt):
    """Return where the pursuer sees the evader after both have moved, from where it saw it before."""
    turn = turning * game.pursuer * dt / game.radius
    chord = game.pursuer * dt * np.sinc(turn / 2 / np.pi)
    x = place[0] + game.evader * dt * math.cos(direction) - chord * math.cos(turn / 2)
    y = place[1] + game.evader * dt * math.sin(direction) - chord * math.sin(turn / 2)
    return math.cos(turn) * x + math.sin(turn) * y, math.cos(turn) * y - math.sin(turn) * x


def weights(place, size, places):
    """Return the bilinear interpolation of values at the nodes at many places, as a matrix."""
    cells = np.clip((np.stack(place) + size) * (places - 1) / (2 * size), 0, places - 1)
    corner = np.minimum(np.floor(cells).astype(int), places - 2)
    (x, y), (on_x, on_y) = corner, cells - corner
    columns = np.stack([x * places + y, x * places + y + 1, (x + 1) * places + y, (x + 1) * places + y + 1])
    shares = np.stack([(1 - on_x) * (1 - on_y), (1 - on_x) * on_y, on_x * (1 - on_y), on_x * on_y])
    ends = 4 * np.arange(x.size + 1)
    return csr_array((shares.T.ravel(), columns.T.ravel(), ends), shape=(x.size, places**2))
