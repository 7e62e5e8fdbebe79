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
    steps = np.full((size, size, 9, 9), math.inf)
    for i, j in product(range(size), repeat=2):
        one, other = first.states[first.order[i]], second.states[second.order[j]]
        if math.dist(one[:2], other[:2]) > farthest:
            continue
        for a, b in product(range(9), repeat=2):
            both = zip(pairwise(first.courses[i][a]), pairwise(second.courses[j][b]), strict=True)
            for number, ((s, s_after), (o, o_after)) in enumerate(both, start=1):
                if closest_pass(s, s_after, o, o_after) < game.capture_distance:
                    steps[i, j, a, b] = number
                    break
    return steps


def failure(game, states):
    """The step of a course in which the robot fails; inf if in none. Who begins in contact fails at once."""
    if clearance(game, states[0]) < 0:
        return 1
    along = [min(gaps(game.arena, game.pursuer.radius, before, after)) for before, after in pairwise(states)]
    return next((number for number, gap in enumerate(along, start=1) if gap < 0), math.inf)


def certain_captures(steps, first, second, pursuing, possible=True):
    """By node, node and action of the first robot: the step of a capture that is certain, inf where none is.

    By the rules: what comes first ends the game, in one step a capture before a failure.

    possible: which answers there are, by node, node and answer.
    """
    own, theirs = first.fails[:, None, :, None], second.fails[None, :, None, :]
    possible = np.broadcast_to(np.asarray(possible)[..., None, :] if possible is not True else True, steps.shape)
    captured = np.isfinite(steps) & (steps <= own) & (steps <= theirs)
    if not pursuing:
        return np.where(captured & possible, steps, math.inf).min(axis=-1)
    won = np.where(captured, steps, np.where(theirs < own, theirs, math.inf))
    latest = np.where(possible, won, -math.inf).max(axis=-1)
    return np.where((captured & possible).any(axis=-1), latest, math.inf)


def guarantee(game, first, second, pursuing, steps, sweeps, horizon, win, lose, hold):
    """What the first robot is sure of before its move, and after it, after so many sweeps."""
    size = len(first.order)
    certain = certain_captures(steps, first, second, pursuing)
    decided = np.isfinite(certain)
    # One number of steps serves all actions that decide: the best that the robot can do with them.
    when = (
        np.where(decided, certain, math.inf).min(axis=-1) if pursuing else np.where(decided, certain, -1).max(axis=-1)
    )
    capture = win if pursuing else lose
    discount = math.exp(-hold * game.dt / horizon)
    moved = np.zeros((size, size))
    before = moved
    for _ in range(sweeps):
        action_values = []
        for action in range(9):
            value = np.where(first.free[:, action, None], discount * (first.matrices[action] @ moved), lose)
            action_values.append(np.where(decided[:, :, action], capture * np.exp(-when * game.dt / horizon), value))
        before = np.max(action_values, axis=0)
        answers = [
            np.where(second.free[None, :, action], before @ second.matrices[action].T, win) for action in range(9)
        ]
        moved = np.min(answers, axis=0)
    return before, moved


def response(game, own, other, pursuing, steps, answers, sweeps, horizon, win, lose, hold):
    """What a robot gets, after so many sweeps, from another one whose actions are known: at each pair of nodes one, or
    several that it takes equally often."""
    size = len(own.order)
    drawn = np.stack([(answers == action).mean(axis=-1) for action in range(9)], axis=-1)  # [own, other's node, action]
    certain_in = certain_captures(steps, own, other, pursuing, drawn > 0)
    decided = np.isfinite(certain_in)
    if pursuing:
        certain, when = decided.any(axis=-1), certain_in.min(axis=-1)
    else:
        certain = (decided | ~own.free[:, None, :]).all(axis=-1) & decided.any(axis=-1)
        when = np.where(decided, certain_in, 0).max(axis=-1)
    captured = (win if pursuing else lose) * np.exp(-when * game.dt / horizon)
    discount = math.exp(-hold * game.dt / horizon)
    values = np.zeros((size, size))
    for _ in range(sweeps):
        moved = np.max(
            [
                np.where(own.free[:, action, None], discount * (own.matrices[action] @ values), lose)
                for action in range(9)
            ],
            axis=0,
        )
        answered = sum(
            drawn[:, :, action] * np.where(other.free[None, :, action], moved @ other.matrices[action].T, win)
            for action in range(9)
        )
        values = np.where(certain, captured, answered)
    return values
