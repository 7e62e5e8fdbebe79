"""The solver a second time: node by node, plain loops, float64, on the rules' twin `numpy_game`.

A grid is four lists of coordinates (x, y, v, heading), a table a dictionary from indices to values.
"""

import math
from itertools import pairwise, product

from tests.oracle.numpy_game import closest_pass, controls, gaps, move


def axes(game, counts):
    body, arena = game.pursuer, game.arena

    def even(low, high, count):
        return [low + (high - low) * index / (count - 1) for index in range(count)]

    x, y, v, heading = counts
    return (
        even(arena.x_min, arena.x_max, x),
        even(arena.y_min, arena.y_max, y),
        even(body.v_min, body.v_max, v),
        [2 * math.pi * index / heading for index in range(heading)],
    )


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


def safety(game, counts, steps, sweeps):
    grid = axes(game, counts)
    states = nodes(grid)
    courses = {index: [course(game, states[index], action, steps) for action in range(9)] for index in states}
    holds = {
        index: [(clearance_along(game, one), corners(grid, one[-1])) for one in many] for index, many in courses.items()
    }
    table = {index: clearance(game, state) for index, state in states.items()}
    for _ in range(sweeps):
        table = {index: max(min(least, value_of(table, end)) for least, end in holds[index]) for index in states}
    return table


def reach(game, counts, steps, sweeps, target, horizon):
    """The capture's discounted value; capture counts before contact in the same step."""
    grid = axes(game, counts)
    states = nodes(grid)

    def event(states):
        for number, (before, after) in enumerate(pairwise(states), start=1):
            if closest_pass(before, after, target, target) < game.capture_distance:
                return math.exp(-number * game.dt / horizon)
            if min(gaps(game.arena, game.pursuer.radius, before, after)) < 0:
                return 0.0
        return None if clearance_along(game, states) >= 0 else 0.0

    courses = {index: [course(game, states[index], action, steps) for action in range(9)] for index in states}
    holds = {index: [(event(one), corners(grid, one[-1])) for one in many] for index, many in courses.items()}
    discount = math.exp(-steps * game.dt / horizon)
    table = dict.fromkeys(states, 0.0)
    for _ in range(sweeps):
        table = {
            index: max(discount * value_of(table, end) if value is None else value for value, end in holds[index])
            for index in states
        }
    return table
