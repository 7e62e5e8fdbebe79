"""The two-robot game on a grid a second time: dense float64 matrices, one per action, and captures pair by pair."""

import math
from itertools import pairwise, product

import numpy as np

from tests.oracle.numpy_game import closest_pass, gaps
from tests.oracle.numpy_solver import axes, clearance, corners, course, indices, nodes


class Robot:
    """One robot's nodes in table order (v, heading, x, y): courses, survived actions, transition matrices."""

    def __init__(self, game, counts, steps):
        grid = axes(game, counts)
        self.states = nodes(grid)
        self.order = sorted(indices(grid), key=lambda index: (index[2], index[3], index[0], index[1]))
        number = {index: position for position, index in enumerate(self.order)}
        self.courses = [
            [course(game, self.states[index], action, steps) for action in range(9)] for index in self.order
        ]
        self.fails = np.array([[failure(game, one) for one in many] for many in self.courses])
        self.free = np.isinf(self.fails)
        self.matrices = np.zeros((9, len(self.order), len(self.order)))
        for position, many in enumerate(self.courses):
            for action, one in enumerate(many):
                for index, weight in corners(grid, one[-1]):
                    self.matrices[action, position, number[index]] += weight


def captures(game, first, second, farthest):
    """The step in which two held actions lead to a capture, by node, node, action, action; inf where they do not."""
    size = len(first.order)
    steps, near = np.full((size, size, 9, 9), math.inf), game.capture_distance
    for i, j in product(range(size), repeat=2):
        one, other = first.states[first.order[i]], second.states[second.order[j]]
        if math.dist(one[:2], other[:2]) > farthest:
            continue
        for a, b in product(range(9), repeat=2):
            both = zip(pairwise(first.courses[i][a]), pairwise(second.courses[j][b]), strict=True)
            for number, ((s, s_after), (o, o_after)) in enumerate(both, start=1):
                if closest_pass(s, s_after, o, o_after) < near:
                    steps[i, j, a, b] = number
                    break
    return steps


def failure(game, states):
    """The step of a course in which the robot fails; inf if in none. Who begins in contact fails at once."""
    if clearance(game, states[0]) < 0:
        return 1
    along = [min(gaps(game.arena, game.pursuer.radius, before, after)) for before, after in pairwise(states)]
    return next((number for number, gap in enumerate(along, start=1) if gap < 0), math.inf)


def certain_captures(steps, first, second, pursuing):
    """By node, node and action of the first robot: the step of a capture that is certain, inf where none is.

    By the rules: what comes first ends the game, in one step a capture before a failure.
    """
    own, theirs = first.fails[:, None, :, None], second.fails[None, :, None, :]
    captured = np.isfinite(steps) & (steps <= own) & (steps <= theirs)
    if not pursuing:
        return np.where(captured, steps, math.inf).min(axis=-1)
    won = np.where(captured, steps, np.where(theirs < own, theirs, math.inf))
    return np.where(captured.any(axis=-1), won.max(axis=-1), math.inf)


def value_before_move(game, first, second, pursuing, steps, sweeps, horizon, hold):
    """The value for the first robot after its move, by so many sweeps, and before it, by half a sweep more."""
    size = len(first.order)
    certain = certain_captures(steps, first, second, pursuing)
    decided = np.isfinite(certain)
    # One number of steps serves all actions that decide: the best that the robot can do with them.
    when = (
        np.where(decided, certain, math.inf).min(axis=-1) if pursuing else np.where(decided, certain, -1).max(axis=-1)
    )
    capture = 1.0 if pursuing else -1.0
    discount = math.exp(-hold * game.dt / horizon)
    captured = capture * np.exp(-when * game.dt / horizon)
    moved = np.zeros((size, size))
    for _ in range(sweeps + 1):
        held = [
            np.where(first.free[:, action, None], discount * (first.matrices[action] @ moved), -1.0)
            for action in range(9)
        ]
        before = np.max([np.where(decided[:, :, a], captured, value) for a, value in enumerate(held)], axis=0)
        last, moved = (
            moved,
            np.min([np.where(second.free[None, :, a], before @ second.matrices[a].T, 1.0) for a in range(9)], axis=0),
        )
    return before, last
