"""Things that move, a second time: float64, by search and by small steps of time instead of by formulas."""

import math
from itertools import pairwise

import numpy as np


def capsule_passes(before, after, centre, centre_after, half_axis):
    """Least distance of points from axes along steps in which both go straight: `[steps]`, arrays `[steps, 2]`.

    Seen from the axis the point goes straight, so its distance from it is a convex function of time.
    """

    def distance(share):
        share = share[:, None]
        place = before + share * (after - before) - centre - share * (centre_after - centre)
        length = np.maximum((half_axis**2).sum(axis=1), 1e-30)
        along = np.clip((place * half_axis).sum(axis=1) / length, -1, 1)
        return np.hypot(*(place - along[:, None] * half_axis).T)

    low, high = np.zeros(len(before)), np.ones(len(before))
    for _ in range(80):
        first, second = low + (high - low) / 3, high - (high - low) / 3
        nearer_first = distance(first) < distance(second)
        low, high = np.where(nearer_first, low, first), np.where(nearer_first, second, high)
    return distance((low + high) / 2)


def legs_of(shuttle):
    """Where a shuttle goes in one period: (start [s], x, y, next x, next y)."""
    route = [*shuttle.waypoints, *shuttle.waypoints[-2::-1]]
    legs, time = [], 0.0
    for (x, y), (next_x, next_y) in pairwise(route):
        legs.append((time, x, y, next_x, next_y))
        time += arrival(math.dist((x, y), (next_x, next_y)), shuttle.v_max, shuttle.a_max) + shuttle.pause
    return legs, time


def legs_of_door(door):
    """Where a door goes in one period: (start [s], x, y, next x, next y)."""
    ends = (door.x, door.y), (door.x + 2 * door.hx, door.y + 2 * door.hy)
    return [(0.0, *ends[0], *ends[1]), (door.period * door.share_open, *ends[1], *ends[0])], door.period


def arrival(length, v_max, a_max):
    """Time of a leg from rest to rest [s]."""
    if length < v_max**2 / a_max:
        return 2 * math.sqrt(length / a_max)
    return length / v_max + v_max / a_max


def place_at(legs, time, v_max, a_max):
    """Place at a time [s] from the start of the period."""
    for start, x, y, next_x, next_y in reversed(legs):
        if time >= start:
            length = math.dist((x, y), (next_x, next_y))
            share = covered(time - start, length, v_max, a_max) / length
            return x + share * (next_x - x), y + share * (next_y - y)
    raise AssertionError("a period begins with a leg")


def covered(time, length, v_max, a_max):
    """Distance covered after a time: as far as with full acceleration, and no farther than allows to brake."""
    total = arrival(length, v_max, a_max)
    if time >= total:
        return length
    if time > total / 2:
        return length - covered(total - time, length, v_max, a_max)
    ramp = v_max / a_max
    return a_max * time**2 / 2 if time < ramp else v_max * (time - ramp / 2)
