"""Lines of sight in NumPy, one pair of points at a time, from the definitions."""

import numpy as np


def meets_disc(a, b, centre, radius):
    """Whether the segment has a point inside a disc, by the roots of a quadratic."""
    d, f = b - a, a - centre
    qa, qb, qc = d @ d, 2 * f @ d, f @ f - radius**2
    if qc < 0:
        return True
    root = qb * qb - 4 * qa * qc
    if root <= 0:
        return False
    first, last = (-qb - np.sqrt(root)) / (2 * qa), (-qb + np.sqrt(root)) / (2 * qa)
    return first < 1 and last > 0


def meets_polygon(a, b, corners):
    """Whether the segment crosses an edge or begins inside, by solving for the crossing of each edge."""
    corners = np.asarray(corners, float)
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        matrix = np.stack([b - a, p - q], axis=1)
        if abs(np.linalg.det(matrix)) < 1e-12:
            continue
        s, t = np.linalg.solve(matrix, p - a)
        if 0 <= s <= 1 and 0 <= t <= 1:
            return True
    angles = np.arctan2(*(corners - a).T[::-1])
    turns = np.diff(np.append(angles, angles[0]))
    return abs(np.sum((turns + np.pi) % (2 * np.pi) - np.pi)) > 1


def meets_cells(a, b, occupied, x, y, cell):
    """Whether the segment has a point in an occupied cell, by clipping it to each of them."""
    for row, column in np.argwhere(occupied):
        low, high = (
            np.array([x + column * cell, y + row * cell]),
            np.array([x + (column + 1) * cell, y + (row + 1) * cell]),
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([(low - a) / (b - a), (high - a) / (b - a)])
        if max(np.min(ends, axis=0).max(), 0) < min(np.max(ends, axis=0).min(), 1):
            return True
    return False
