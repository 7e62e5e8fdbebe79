"""How many pursuers are enough on a graph, beside graphs for which it is known and a game tree searched plainly."""

import itertools

import numpy as np
import pytest

from apollonius.solve.enough import core, solve_chase


def graph(count, links):
    adjacency = np.zeros((count, count), bool)
    for one, other in links:
        adjacency[one, other] = adjacency[other, one] = True
    return adjacency


def path(count):
    return graph(count, [(i, i + 1) for i in range(count - 1)])


def cycle(count):
    return graph(count, [(i, (i + 1) % count) for i in range(count)])


def grid(columns, rows):
    beside = [(i, i + 1) for i in range(columns * rows) if (i + 1) % columns]
    return graph(columns * rows, beside + [(i, i + columns) for i in range(columns * (rows - 1))])


def petersen():
    return graph(10, [link for i in range(5) for link in ((i, (i + 1) % 5), (i, i + 5), (i + 5, (i + 2) % 5 + 5))])


def dodecahedron():
    """Four rings of five corners, the outer and the inner pentagon and a cycle of ten between them."""
    links = []
    for i in range(5):
        links += [(i, (i + 1) % 5), (i, 5 + i), (5 + i, 10 + i), (10 + i, 5 + (i + 1) % 5), (10 + i, 15 + i)]
        links.append((15 + i, 15 + (i + 1) % 5))
    return graph(20, links)


def enough(adjacency):
    return next(count for count in itertools.count(1) if solve_chase(adjacency, count).all())


@pytest.mark.parametrize(
    ("adjacency", "known"),
    [(path(1), 1), (path(7), 1), (cycle(3), 1), (cycle(30), 2), (grid(3, 4), 2), (petersen(), 3), (dodecahedron(), 3)],
    ids=["point", "path", "triangle", "cycle", "grid", "Petersen", "dodecahedron"],
)
def test_known_graphs(adjacency, known):
    assert enough(adjacency) == known
    kept = core(adjacency)
    assert (len(kept) == 1) == (known == 1)
    assert enough(adjacency[np.ix_(kept, kept)]) == known


def plainly_caught(adjacency, pursuers):
    """States from which the evader is caught, by the definition: who moves there is told by the last entry."""
    nodes = range(len(adjacency))
    near = [[j for j in nodes if i == j or adjacency[i, j]] for i in nodes]
    teams = list(itertools.product(nodes, repeat=pursuers))
    won = {(team, e, turn) for team in teams for e in nodes for turn in (0, 1) if e in team}
    while True:
        new = set()
        for team, e in itertools.product(teams, nodes):
            if any((there, e, 1) in won for there in itertools.product(*(near[p] for p in team))):
                new.add((team, e, 0))
            if all((team, there, 0) in won for there in near[e]):
                new.add((team, e, 1))
        if new <= won:
            return won
        won |= new


def chords(seed):
    """A cycle of nine and some links across it."""
    ends = np.random.default_rng(seed).integers(9, size=(3, 2))
    return cycle(9) | graph(9, [(i, j) for i, j in ends if i != j])


MIXED = np.array([[4, 0, 7, 2, 8, 5, 1, 6, 3]])


@pytest.mark.parametrize(
    ("adjacency", "pursuers"),
    [(chords(0), 1), (chords(1), 1), (chords(2), 2), (petersen(), 1), (petersen(), 2), (path(9)[MIXED, MIXED.T], 1)],
    ids=["chords", "other chords", "two among chords", "one on Petersen", "two on Petersen", "on a path, out of order"],
)
def test_every_state_is_as_a_plain_search_says(adjacency, pursuers):
    won, caught = plainly_caught(adjacency, pursuers), solve_chase(adjacency, pursuers)
    for evader, *team in np.ndindex(caught.shape):
        assert caught[(evader, *team)] == ((tuple(team), evader, 0) in won)
