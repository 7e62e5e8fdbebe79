"""Circles in a tournament are found where there are some, and only where the games are enough to tell."""

from dataclasses import replace

import numpy as np
import pytest

from apollonius.evaluate.cycles import cycles
from apollonius.evaluate.match import MatchResult
from apollonius.evaluate.tournament import Tournament

EMPTY = MatchResult(0, {}, 0.0, (0.0, 0.0), 0.0, (0.0, 0.0), 0.0, 0.0, None, 0.0)


def tournament(rates, games):
    """Of players P0, P1, ... and E0, E1, ..."""
    matches = tuple(tuple(replace(EMPTY, games=games, pursuer_win_rate=rate) for rate in row) for row in rates)
    rows, columns = np.shape(rates)
    pursuers, evaders = tuple(f"P{number}" for number in range(rows)), tuple(f"E{number}" for number in range(columns))
    return Tournament(pursuers, evaders, matches)


def test_each_is_the_better_answer_to_the_one_before():
    (cycle,) = cycles(tournament([[0.2, 0.9], [0.8, 0.3]], 100))
    assert (cycle.pursuers, cycle.evaders) == (("P0", "P1"), ("E1", "E0"))
    assert cycle.gap == pytest.approx(0.8 - 0.3)


def test_a_circle_of_few_games_is_not_told_from_chance():
    assert cycles(tournament([[0.4, 0.6], [0.6, 0.4]], 20)) == []
    assert len(cycles(tournament([[0.4, 0.6], [0.6, 0.4]], 2000))) == 1


def test_where_one_is_the_best_there_is_no_circle():
    """A rating explains these rates, and the last pursuer is best against everyone."""
    assert cycles(tournament([[0.1, 0.3, 0.5], [0.2, 0.5, 0.6], [0.5, 0.6, 0.8]], 5000)) == []


def test_all_circles_are_found_the_widest_first():
    rates = 0.5 + 0.4 * np.array([[0, -1, 1], [1, 0, -1], [-1, 1, 0]])
    found = cycles(tournament(rates.tolist(), 1000))
    brute = 0
    for i in range(3):
        for k in range(i):
            for j in range(3):
                for m in range(j):
                    a, b, c, d = rates[i, j], rates[i, m], rates[k, j], rates[k, m]
                    brute += min(a, d) > max(b, c) or min(b, c) > max(a, d)
    assert len(found) == brute > 0
    assert [cycle.gap for cycle in found] == sorted((cycle.gap for cycle in found), reverse=True)
