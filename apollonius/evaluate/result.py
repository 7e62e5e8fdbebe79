"""What a match comes to: counts, rates with their intervals, and lengths of games."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Array, Int

from apollonius.arenas.record import from_dict
from apollonius.evaluate.statistics import mean_interval
from apollonius.game.by_side import BySide
from apollonius.game.outcome import PURSUER_WINS, names_of, require_counts
from apollonius.game.scenario import Scenario
from apollonius.game.types import RobotStatus
from apollonius.io.errors import require
from apollonius.io.limits import MOST_COUNTED
from apollonius.play.playout import Results


@dataclass(frozen=True)
class RobotCounts:
    """Robots of all games together, by their status at the end."""

    pursuers: dict[str, int]
    evaders: dict[str, int]

    def __post_init__(self) -> None:
        known = {status.name.lower() for status in RobotStatus}
        for side in (self.pursuers, self.evaders):
            possible = known - {"hit_mate"} <= set(side) <= known and min(side.values()) >= 0
            require(possible, "robots", side, f"counts of {', '.join(sorted(known))}")

    @property
    def captured(self) -> int:
        """Evaders that were captured."""
        return self.evaders["captured"]

    @property
    def lost(self) -> BySide[int]:
        """Robots of either side that put themselves out: by an obstacle, a wall or a mate."""
        failures = [status.name.lower() for status in RobotStatus if status > RobotStatus.CAPTURED]
        return BySide(self.pursuers, self.evaders).map(lambda side: sum(side.get(name, 0) for name in failures))


def count_robots(statuses: BySide[tuple[Int[Array, " games"], ...]]) -> RobotCounts:
    """Count the robots of games that have ended; of collisions of mates nothing is said where there were none."""

    def by_name(side: tuple[Int[Array, " games"], ...]) -> dict[str, int]:
        counts = np.bincount(np.concatenate([np.asarray(status) for status in side]), minlength=len(RobotStatus))
        named = {status.name.lower(): int(counts[status]) for status in RobotStatus}
        return {name: count for name, count in named.items() if name != "hit_mate" or count}

    return RobotCounts(*map(by_name, statuses))


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


@dataclass(frozen=True)
class MatchResult:
    """What a match came to. Rates are in [0, 1], with Wilson 95 % intervals."""

    games: int
    outcomes: dict[str, int]
    """Games by outcome: the rows of Tables II and III, plus `both_failed`."""
    pursuer_win_rate: float
    """Captured, or only the evader failed."""
    pursuer_win_interval: tuple[float, float]
    evader_win_rate: float
    """Only the pursuer failed, or the time limit was reached where the rules count that as the evader's win."""
    evader_win_interval: tuple[float, float]
    evader_undefeated_rate: float
    """Everything but the pursuer's wins and double failures (Fig. 6)."""
    mean_steps: float
    mean_capture_steps: float | None
    """Over the captured games; None if there are none."""
    doomed_start_rate: float | None
    """Share of the starts from which a robot cannot help crashing (`apollonius.solve.viability`); None if unknown."""
    capture_steps_deviation: float | None = None
    """Standard deviation of the length of the captured games; None if there are none."""
    pursuer_change: tuple[float, float] | None = None
    """Mean |change of u1| and of u2 per step, as shares of their largest values; None where it was not measured."""
    evader_change: tuple[float, float] | None = None
    """The same of the evader."""
    arenas: ByArena | None = None
    """The same match by arenas, where there are several."""
    robots: RobotCounts | None = None
    """What became of the robots, in a game of teams."""

    def to_dict(self) -> dict[str, Any]:
        """The result as JSON-like data; nothing of arenas where there is one only, or of robots where they are two."""
        data = asdict(self)
        return {name: value for name, value in data.items() if name not in ("arenas", "robots") or value is not None}

    def require_possible(self, source: str) -> None:
        """Refuse what no games come to: a result that a file holds need not be one.

        Args:
            source: where it comes from, for the message.

        Raises:
            InvalidInput: for counts that do not add up, rates that are none or not those of the counts, and lengths
                of games that cannot be.
        """
        require(1 <= self.games <= MOST_COUNTED, f"{source}: games", self.games, f"from 1 to {MOST_COUNTED:,}")
        require_counts(self.outcomes, source, self.games)
        won = sum(self.outcomes[name] for name in names_of(PURSUER_WINS)) / self.games
        captured = self.outcomes["captured"] > 0
        lengths = (self.mean_steps, self.mean_capture_steps or 0, self.capture_steps_deviation or 0)
        (low, high), (evader_low, evader_high) = self.pursuer_win_interval, self.evader_win_interval
        for name, possible, bound in (
            ("pursuer_win_rate", abs(self.pursuer_win_rate - won) < 1e-9, f"{won}, as of its outcomes"),
            ("pursuer_win_interval", 0 <= low <= self.pursuer_win_rate <= high <= 1, "in [0, 1], around the rate"),
            ("evader_win_rate", 0 <= self.evader_win_rate <= 1, "in [0, 1]"),
            (
                "evader_win_interval",
                0 <= evader_low <= self.evader_win_rate <= evader_high <= 1,
                "in [0, 1], around the rate",
            ),
            ("evader_undefeated_rate", 0 <= self.evader_undefeated_rate <= 1, "in [0, 1]"),
            ("doomed_start_rate", 0 <= (self.doomed_start_rate or 0) <= 1, "in [0, 1]"),
            ("mean_steps", all(0 <= steps <= MOST_COUNTED for steps in lengths), "that of games"),
            ("mean_capture_steps", (self.mean_capture_steps is not None) == captured, "given where games are captured"),
            ("capture_steps_deviation", (self.capture_steps_deviation is not None) == captured, "given with the mean"),
            ("pursuer_change", all(0 <= change <= 2 for change in self.pursuer_change or ()), "from 0 to 2"),
            ("evader_change", all(0 <= change <= 2 for change in self.evader_change or ()), "from 0 to 2"),
        ):
            require(possible, f"{source}: {name}", getattr(self, name), bound)


def read_result(data: Any, source: str) -> MatchResult:
    """Return the result of a match from what `MatchResult.to_dict` wrote; errors as of `require_possible`."""
    require(isinstance(data, dict), source, data, "the result of a match")
    result = from_dict(MatchResult, data, source)
    result.require_possible(source)
    return result
