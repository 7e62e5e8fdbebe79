"""Circles in a tournament: who answers whom, round and round, so that nobody is the best."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from apollonius.evaluate.statistics import difference_interval
from apollonius.evaluate.tournament import Tournament


@dataclass(frozen=True)
class Cycle:
    """Two pursuers and two evaders of whom each is the better answer to one of the others.

    The first pursuer does better against the first evader than the second pursuer does; against the first pursuer the
    second evader does better; against that the second pursuer; and against that the first evader. It is a cell of the
    tournament without a saddle: the smallest game in which no side has a best player.

    Attributes:
        gap: the smallest of the four gains, a difference of the pursuer's win rate.
    """

    pursuers: tuple[str, str]
    evaders: tuple[str, str]
    gap: float


def cycles(tournament: Tournament) -> list[Cycle]:
    """All cycles whose four gains each have a 95 % interval above 0, those of the largest gap first.

    Matches are taken as independent, so on paired starts fewer are found than there are.
    """
    rates, games = tournament.win_rates, tournament.games
    found = []
    for row, other_row, column, other_column in _cells(rates.shape):
        cell = rates[np.ix_([row, other_row], [column, other_column])]
        better, worse = np.array([cell[0, 0], cell[1, 1]]), np.array([cell[0, 1], cell[1, 0]])
        if min(better) <= max(worse):
            continue
        if all(difference_interval(high, low, games)[0] > 0 for high in better for low in worse):
            pursuers = tournament.pursuers[row], tournament.pursuers[other_row]
            evaders = tournament.evaders[column], tournament.evaders[other_column]
            found.append(Cycle(pursuers, evaders, float(min(better) - max(worse))))
    return sorted(found, key=lambda cycle: -cycle.gap)


def _cells(shape: tuple[int, int]) -> Iterator[tuple[int, int, int, int]]:
    """Every pair of rows and every pair of columns, in either order of columns."""
    for rows in combinations(range(shape[0]), 2):
        for columns in combinations(range(shape[1]), 2):
            for one, other in (columns, columns[::-1]):
                yield rows[0], rows[1], one, other
