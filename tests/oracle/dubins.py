"""Shortest paths of bounded curvature between two poses (Dubins, 1957), in float64, for many pairs at once.

Each is three segments, of six possible words: L and R are arcs of the smallest radius to the left and right, S is
straight. Lengths by Shkel and Lumelsky (2001), with the radius as the unit; the words that begin with R are mirror
images of those that begin with L.
"""

import numpy as np

CURVES = {"L": 1, "S": 0, "R": -1}
"""The curvature of a segment."""
WORDS = ("LSL", "LSR", "LRL", "RSR", "RSL", "RLR")


def best_words(start, goal, radius):
    """Return the number of the shortest word for each pair of poses and its segments' lengths.

    Args:
        start, goal: x, y and heading, `[3, pairs]`.
        radius: the smallest radius.
    """
    lengths = radius * all_words(start, goal, radius)
    best = np.argmin(lengths.sum(axis=1), axis=0)
    return best, np.take_along_axis(lengths, best[None, None], axis=0)[0]


def shortest(start, goal, radius):
    """Return the length of the shortest path between each pair of poses."""
    return best_words(start, goal, radius)[1].sum(axis=0)


def all_words(start, goal, radius):
    """Return the lengths of each word's segments in radii, `[words, 3, pairs]`: infinite where there is no path."""
    across, along = goal[1] - start[1], goal[0] - start[0]
    bearing = np.arctan2(across, along)
    leaving, arriving = start[2] - bearing, goal[2] - bearing
    distance = np.hypot(across, along) / radius
    by_side = [left_words(distance, side * leaving, side * arriving) for side in (1, -1)]
    return np.concatenate(by_side)


def left_words(distance, leaving, arriving):
    """Return the same for LSL, LSR and LRL, from a pose at the origin to one on the x-axis, by their headings."""
    sine, cosine = np.sin(leaving), np.cos(leaving)
    other_sine, other_cosine = np.sin(arriving), np.cos(arriving)
    between = np.cos(leaving - arriving)
    same_side = distance + sine - other_sine, other_cosine - cosine
    other_side = distance + sine + other_sine, -cosine - other_cosine

    straight = np.hypot(*same_side)
    course = np.arctan2(same_side[1], same_side[0])
    lsl = course - leaving, straight, arriving - course

    square = distance**2 - 2 + 2 * between + 2 * distance * (sine + other_sine)
    straight = np.sqrt(np.maximum(square, 0))
    crossing = np.arctan2(other_side[1], other_side[0]) + np.arctan2(2, straight)
    lsr = crossing - leaving, straight, crossing - arriving

    share = (6 - distance**2 + 2 * between - 2 * distance * (sine - other_sine)) / 8
    middle = 2 * np.pi - np.arccos(np.clip(share, -1, 1))
    first = course - leaving + middle / 2
    lrl = first, middle, arriving - leaving - first + middle

    words = [np.stack(positive_arcs(word, name)) for word, name in zip((lsl, lsr, lrl), WORDS[:3], strict=True)]
    exists = True, square >= 0, abs(share) <= 1
    return np.stack([np.where(there, word, np.inf) for there, word in zip(exists, words, strict=True)])


def positive_arcs(word, name):
    """Return a word's segments with each arc's turn in [0, 2 pi)."""
    return [part if curve == "S" else np.mod(part, 2 * np.pi) for part, curve in zip(word, name, strict=True)]
