"""How a match in several arenas went in each of them."""

from dataclasses import dataclass

import numpy as np

from apollonius.errors import require
from apollonius.evaluate.statistics import mean_interval
from apollonius.game.outcome import PURSUER_WINS
from apollonius.game.scenario import Scenario
from apollonius.playout import Results

WORST = 0.1
"""Share of the arenas that count as the worst."""


@dataclass(frozen=True)
class ByArena:
    """The pursuer's wins in each arena, in the order of the scenario, and games in each."""

    wins: tuple[int, ...]
    games: tuple[int, ...]

    def __post_init__(self) -> None:
        counts = list(zip(self.wins, self.games, strict=False))
        possible = len(self.wins) == len(self.games) > 0 and all(0 <= won <= games > 0 for won, games in counts)
        require(possible, "wins by arena", counts, "wins of 1 game or more in each arena")

    @property
    def rates(self) -> list[float]:
        """The share of wins in each arena."""
        return [won / played for won, played in zip(self.wins, self.games, strict=True)]

    @property
    def mean(self) -> float:
        """The mean of the rates."""
        return float(np.mean(self.rates))

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of that mean over arenas drawn in the same way, by Student's t."""
        return mean_interval(self.rates, 0.0, 1.0)

    @property
    def worst(self) -> float:
        """The mean of the rates in the tenth of the arenas where they are least; of one at least."""
        return float(np.mean(sorted(self.rates)[: max(1, round(WORST * len(self.rates)))]))

    @property
    def least(self) -> float:
        """The least of the rates."""
        return min(self.rates)


def count_by_arena(scenario: Scenario, results: Results) -> ByArena:
    """Count the games of a match, whose i-th game is at the i-th place of `Scenario.place_of`."""
    outcome = np.asarray(results.outcome)
    arena = np.asarray(scenario.place_of(np.arange(len(outcome)))) % scenario.count
    games = np.bincount(arena, minlength=scenario.count)
    won = np.bincount(arena[np.isin(outcome, PURSUER_WINS)], minlength=scenario.count)
    played = games > 0
    return ByArena(tuple(won[played].tolist()), tuple(games[played].tolist()))
