"""A chase along a line without interpolation: exact values of either robot that moves first, by plain arrays.

Places are 0.15 m apart and speeds 0.3 m/s, so that a second of any action leads from one state to another. Walls are at
0 and `LENGTH`, radii are 0.05 m, the capture distance is 0.31 m. The opponent sees the action of who moves first.
"""

import numpy as np

PLACES, SPEEDS, STEPS, DT, NEAR, RADIUS = 25, 5, 10, 0.1, 0.31, 0.05
LENGTH = 0.15 * (PLACES - 1)


def courses():
    """Places [m] at the ends of all steps, `[place, speed, action, step]`, and the state that a hold leads to."""
    place, speed, action = np.meshgrid(np.arange(PLACES), np.arange(SPEEDS), [-1, 0, 1], indexing="ij")
    x, v = [0.15 * place], 0.3 * speed
    for _ in range(STEPS):
        after = np.clip(v + 0.3 * action * DT, 0.0, 1.2)
        middle = np.where((v + 0.3 * action * DT < 0) | (v + 0.3 * action * DT > 1.2), after, (v + after) / 2)
        x.append(x[-1] + middle * DT)
        v = after
    return np.stack(x, axis=-1).reshape(-1, 3, STEPS + 1), v.reshape(-1, 3)


def values(pursuing, horizon):
    """The value for the robot that moves first, by its state and the other's: state = place * speeds + speed."""
    x, v = courses()
    touches = (x[..., 1:] < RADIUS) | (x[..., 1:] > LENGTH - RADIUS)
    fails = np.where(touches, np.arange(1, STEPS + 1), STEPS + 1).min(axis=-1)
    end = np.clip(np.round(x[..., -1] / 0.15), 0, PLACES - 1) * SPEEDS + np.round(v / 0.3)
    end = end.astype(int)
    discount = np.exp(-STEPS * DT / horizon)
    size = PLACES * SPEEDS
    ended, over = np.zeros((3, 3, size, size)), np.zeros((3, 3, size, size), bool)
    for a in range(3):
        for b in range(3):
            gap = x[:, a][:, None] - x[:, b][None]
            least = np.minimum(np.abs(gap[..., :-1]), np.abs(gap[..., 1:]))
            least = np.where(gap[..., :-1] * gap[..., 1:] < 0, 0.0, least)
            caught = np.where(least < NEAR, np.arange(1, STEPS + 1), STEPS + 1).min(axis=-1)
            own, other = fails[:, a][:, None], fails[:, b][None]
            first = np.minimum(np.minimum(own, other), caught)
            capture = caught == first
            won = np.where(capture, pursuing, other < own)
            lost = np.where(capture, not pursuing, own < other)
            over[a, b] = first <= STEPS
            ended[a, b] = np.exp(-first * DT / horizon) * (won * 1.0 - lost * 1.0)
    value = np.zeros((size, size))
    for _ in range(400):
        value = np.max(
            [
                np.min(
                    [
                        np.where(over[a, b], ended[a, b], discount * value[np.ix_(end[:, a], end[:, b])])
                        for b in range(3)
                    ],
                    axis=0,
                )
                for a in range(3)
            ],
            axis=0,
        )
    return value
