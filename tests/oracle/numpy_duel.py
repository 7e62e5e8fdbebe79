"""The two-robot game on a grid a second time: dense float64 matrices, one per action, and captures pair by pair."""

import math
from itertools import pairwise, product

import numpy as np

from tests.oracle.numpy_game import closest_pass
from tests.oracle.numpy_solver import axes, corners, course, indices, nodes, room


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
        self.free = np.array([[room(game, one) >= 0 for one in many] for many in self.courses])
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


def certain_captures(steps, first, second, pursuing):
    """By node, node and action of the first robot: the step of a capture that is certain, inf where none is."""
    if pursuing:
        answered = np.where(second.free[None, :, None, :], steps, -math.inf).max(axis=-1)
        answered[answered == -math.inf] = math.inf
    else:
        answered = np.where(second.free[None, :, None, :], steps, math.inf).min(axis=-1)
    return np.where(first.free[:, None, :], answered, math.inf)


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
    possible = (drawn > 0) & other.free[None]
    by_answer = np.where(possible[:, :, None], steps, -math.inf if pursuing else math.inf)
    certain_in = by_answer.max(axis=-1) if pursuing else by_answer.min(axis=-1)
    certain_in = np.where(own.free[:, None] & np.isfinite(certain_in), certain_in, math.inf)
    decided = np.isfinite(certain_in)
    if pursuing:
        certain, when = decided.any(axis=-1), certain_in.min(axis=-1)
    else:
        certain = (decided == own.free[:, None, :]).all(axis=-1)
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
