"""The solvers a second time: node by node, plain loops, float64, on the rules' twin `numpy_game`.

A grid is four lists of coordinates (x, y, v, heading), a table a dictionary from indices to values. In the game of two
it is a dense matrix, with one of transitions for each action, and captures are found pair by pair.
"""

import math
from functools import partial
from itertools import pairwise, product

import numpy as np

from tests.oracle.numpy_game import closest_pass, controls, gaps, move


def axes(game, counts):
    body, arena = game.pursuer, game.arena

    *even, heading = counts
    ends = (arena.x_min, arena.x_max), (arena.y_min, arena.y_max), (body.v_min, body.v_max)
    axes = [np.linspace(*end, count).tolist() for end, count in zip(ends, even, strict=True)]
    return (*axes, [2 * math.pi * index / heading for index in range(heading)])


def nodes(grid):
    return {index: tuple(axis[i] for axis, i in zip(grid, index, strict=True)) for index in indices(grid)}


def indices(grid):
    return list(product(*(range(len(axis)) for axis in grid)))


def corners(grid, robot):
    """The nodes around a state and their multilinear weights; places beyond the ends are taken for the end."""
    beside = []
    for axis, coordinate in zip(grid[:3], robot[:3], strict=True):
        position = min(max((coordinate - axis[0]) / (axis[1] - axis[0]), 0), len(axis) - 1)
        lower = min(int(position), len(axis) - 2)
        beside.append(((lower, 1 - (position - lower)), (lower + 1, position - lower)))
    count = len(grid[3])
    position = (robot[3] % (2 * math.pi)) / (2 * math.pi) * count
    lower = math.floor(position)
    beside.append(((lower % count, 1 - (position - lower)), ((lower + 1) % count, position - lower)))
    return [
        (tuple(index for index, _ in corner), math.prod(weight for _, weight in corner)) for corner in product(*beside)
    ]


def value_of(table, corners):
    return sum(weight * table[index] for index, weight in corners)


def course(game, robot, action, steps):
    states = [robot]
    for _ in range(steps):
        states.append(move(game.pursuer, states[-1], controls(game.pursuer, action), game.dt))
    return states


def clearance(game, robot):
    return min(gaps(game.arena, game.pursuer.radius, robot, robot))


def clearance_along(game, states):
    """Least clearance along a course; the walls bound a convex region, so their ends tell all."""
    steps = pairwise(states)
    along = [min(gaps(game.arena, game.pursuer.radius, before, after)) for before, after in steps]
    return min(clearance(game, states[0]), *along)


def swept(game, counts, steps, sweeps, first, known, backup):
    """The table of first values after some sweeps over all nodes, by what is known of a course and the value beyond."""
    grid = axes(game, counts)
    states = nodes(grid)
    courses = {index: [course(game, states[index], action, steps) for action in range(9)] for index in states}
    holds = {index: [(known(one), corners(grid, one[-1])) for one in many] for index, many in courses.items()}
    table = {index: first(state) for index, state in states.items()}
    for _ in range(sweeps):
        table = {index: max(backup(found, value_of(table, end)) for found, end in holds[index]) for index in states}
    return table


def safety(game, counts, steps, sweeps):
    return swept(game, counts, steps, sweeps, partial(clearance, game), partial(clearance_along, game), min)


def reach(game, counts, steps, sweeps, target, horizon):
    """The capture's discounted value; capture counts before contact in the same step."""

    def event(states):
        for number, (before, after) in enumerate(pairwise(states), start=1):
            if closest_pass(before, after, target, target) < game.capture_distance:
                return math.exp(-number * game.dt / horizon)
            if min(gaps(game.arena, game.pursuer.radius, before, after)) < 0:
                return 0.0
        return None if clearance_along(game, states) >= 0 else 0.0

    def backup(value, beyond):
        return math.exp(-steps * game.dt / horizon) * beyond if value is None else value

    return swept(game, counts, steps, sweeps, lambda state: 0.0, event, backup)


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
            passed = (number for number, (s, o) in enumerate(both, start=1) if closest_pass(*s, *o) < near)
            steps[i, j, a, b] = next(passed, math.inf)
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
