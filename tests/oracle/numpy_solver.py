"""The solvers a second time, on the rules' twin `numpy_game`: plain loops, dense float64 matrices, one for each action.

Tables are by a robot's nodes in the order (v, heading, x, y), captures pair by pair.
"""

import math
from functools import cached_property
from itertools import pairwise, product

import numpy as np

from tests.oracle.numpy_game import closest_pass, controls, gaps, move


class Robot:
    """One robot's nodes, the courses of its nine actions, held, and by action and node the shares of nodes after it."""

    def __init__(self, game, counts, steps):
        body, arena, (x, y, v, heading) = game.pursuer, game.arena, counts
        self.game, self.seconds = game, steps * game.dt
        self.axes = (
            np.linspace(body.v_min, body.v_max, v).tolist(),
            [math.tau * index / heading for index in range(heading)],
            np.linspace(arena.x_min, arena.x_max, x).tolist(),
            np.linspace(arena.y_min, arena.y_max, y).tolist(),
        )
        self.shape = tuple(map(len, self.axes))
        self.states = [(x, y, v, heading) for v, heading, x, y in product(*self.axes)]
        self.courses = [[course(game, state, action, steps) for action in range(9)] for state in self.states]
        self.after = np.zeros((9, len(self.states), len(self.states)))
        for node, many in enumerate(self.courses):
            for action, one in enumerate(many):
                for index, weight in corners(self.axes, one[-1]):
                    self.after[action, node, np.ravel_multi_index(index, self.shape)] += weight

    def by_course(self, function):
        """What a function makes of each course, by action and node."""
        return np.array([[function(one) for one in many] for many in self.courses]).T

    @cached_property
    def fails(self):
        """The steps of courses in which the robot fails; inf if in none. Who begins in contact fails at once."""

        def failure(states):
            start, *along = room(self.game, states)
            return 1 if start < 0 else next((number for number, gap in enumerate(along, start=1) if gap < 0), math.inf)

        return self.by_course(failure)

    @cached_property
    def free(self):
        return np.isinf(self.fails)


def corners(axes, robot):
    """The nodes around a state and their multilinear weights; places beyond the ends are taken for the end."""
    x, y, v, heading = robot
    beside = []
    for axis, coordinate in zip((axes[0], *axes[2:]), (v, x, y), strict=True):
        position = min(max((coordinate - axis[0]) / (axis[1] - axis[0]), 0), len(axis) - 1)
        lower = min(int(position), len(axis) - 2)
        beside.append(((lower, 1 - (position - lower)), (lower + 1, position - lower)))
    count = len(axes[1])
    position = (heading % math.tau) / math.tau * count
    lower = math.floor(position)
    beside.insert(1, ((lower % count, 1 - (position - lower)), ((lower + 1) % count, position - lower)))
    return [
        (tuple(index for index, _ in corner), math.prod(weight for _, weight in corner)) for corner in product(*beside)
    ]


def course(game, robot, action, steps):
    states = [robot]
    for _ in range(steps):
        states.append(move(game.pursuer, states[-1], controls(game.pursuer, action), game.dt))
    return states


def clearance(game, robot):
    return min(gaps(game.arena, game.pursuer.radius, robot, robot))


def room(game, states):
    """Clearance at the start of a course and along its steps; the walls bound a convex region, so ends tell all."""
    steps = pairwise(states)
    return [clearance(game, states[0]), *(min(gaps(game.arena, game.pursuer.radius, *step)) for step in steps)]


def safety(game, robot, sweeps):
    least = robot.by_course(lambda states: min(room(game, states)))
    table = np.array([clearance(game, state) for state in robot.states])
    for _ in range(sweeps):
        table = np.minimum(least, robot.after @ table).max(axis=0)
    return table.reshape(robot.shape)


def reach(game, robot, sweeps, target, horizon):
    """The capture's discounted value; capture counts before contact in the same step."""

    def event(states):
        for number, (before, after) in enumerate(pairwise(states), start=1):
            if closest_pass(before, after, target, target) < game.capture_distance:
                return math.exp(-number * game.dt / horizon)
            if min(gaps(game.arena, game.pursuer.radius, before, after)) < 0:
                return 0.0
        return math.nan if min(room(game, states)) >= 0 else 0.0

    values, table = robot.by_course(event), np.zeros(len(robot.states))
    for _ in range(sweeps):
        later = math.exp(-robot.seconds / horizon) * (robot.after @ table)
        table = np.where(np.isnan(values), later, values).max(axis=0)
    return table.reshape(robot.shape)


def captures(game, first, second):
    """The step in which two held actions lead to a capture, by node, node, action, action; inf where they do not."""
    one, other = (np.array(robot.courses)[..., :2] for robot in (first, second))
    apart = one[:, None, :, None] - other[None, :, None]
    start, along = apart[..., :-1, :], np.diff(apart, axis=-2)
    nearest = -(start * along).sum(axis=-1) / np.maximum((along**2).sum(axis=-1), 1e-12)
    near = np.linalg.norm(start + np.clip(nearest, 0, 1)[..., None] * along, axis=-1) < game.capture_distance
    return np.where(near.any(axis=-1), near.argmax(axis=-1) + 1, math.inf)


def certain_captures(steps, first, second, pursuing):
    """By action of the first robot and both nodes: the step of a capture that is certain, inf where none is.

    By the rules: what comes first ends the game, in one step a capture before a failure.
    """
    own, theirs = first.fails.T[:, None, :, None], second.fails.T[None, :, None, :]
    captured = np.isfinite(steps) & (steps <= own) & (steps <= theirs)
    if not pursuing:
        return np.where(captured, steps, math.inf).min(axis=-1)
    won = np.where(captured, steps, np.where(theirs < own, theirs, math.inf))
    return np.where(captured.any(axis=-1), won.max(axis=-1), math.inf)


def value_before_move(first, second, pursuing, steps, sweeps, horizon):
    """The value for the first robot after its move, by so many sweeps, and before it, by half a sweep more."""
    certain = certain_captures(steps, first, second, pursuing)
    decided = np.isfinite(certain)
    # One number of steps serves all actions that decide: the best that the robot can do with them.
    when = (
        np.where(decided, certain, math.inf).min(axis=-1) if pursuing else np.where(decided, certain, -1).max(axis=-1)
    )
    captured = (1.0 if pursuing else -1.0) * np.exp(-when * first.game.dt / horizon)
    discount, moved = math.exp(-first.seconds / horizon), np.zeros(decided.shape[:2])
    for _ in range(sweeps + 1):
        held = np.where(first.free[..., None], discount * (first.after @ moved), -1.0)
        before = np.where(np.moveaxis(decided, -1, 0), captured, held).max(axis=0)
        answered = before @ np.swapaxes(second.after, 1, 2)
        last, moved = moved, np.where(second.free[:, None], answered, 1.0).min(axis=0)
    return before, last
