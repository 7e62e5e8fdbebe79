"""The result of a match: counts, rates with their intervals, and lengths of games."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from jaxtyping import Array, Float, Int

from apollonius.arenas.file import from_dict
from apollonius.evaluate.statistics import mean_interval, wilson_interval
from apollonius.game.outcome import PURSUER_WINS, evader_winning, names_of, require_counts
from apollonius.game.scenario import Scenario
from apollonius.game.types import BySide, RobotStatus, Role
from apollonius.io.errors import require
from apollonius.observe.tracking import Sightings
from apollonius.play.playout import Results


def count_robots(statuses: BySide[tuple[Int[Array, " games"], ...]]) -> dict[str, dict[str, int]]:
    """Count the robots of ended games by side and status; collisions of mates only where there were
    some.
    """

    def by_name(side: tuple[Int[Array, " games"], ...]) -> dict[str, int]:
        statuses = np.concatenate([np.asarray(status) for status in side])
        histogram = np.bincount(statuses, minlength=len(RobotStatus))
        counts_by_status = {status.name.lower(): int(histogram[status]) for status in RobotStatus}
        if not counts_by_status["hit_mate"]:
            del counts_by_status["hit_mate"]
        return counts_by_status

    return {"pursuers": by_name(statuses.pursuer), "evaders": by_name(statuses.evader)}


WORST = 0.1
"""Share of the arenas that count as the worst."""


def worst_mean(values: Sequence[float] | Float[np.ndarray, " arenas"]) -> float:
    """Return the mean of the least tenth of the values, at least of one."""
    return float(np.mean(sorted(values)[: max(1, round(WORST * len(values)))]))


@dataclass(frozen=True)
class ByArena:
    """The pursuer's wins in each arena, in the order of the scenario, and games in each."""

    wins: tuple[int, ...]
    games: tuple[int, ...]

    @property
    def rates(self) -> list[float]:
        """The share of wins in each arena."""
        return [wins / games for wins, games in zip(self.wins, self.games, strict=True)]

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
        """The mean of the rates in the worst tenth of the arenas, at least of one."""
        return worst_mean(self.rates)


def count_by_arena(scenario: Scenario, results: Results) -> ByArena:
    """Count the games of a match, whose i-th game is at the i-th place of `Scenario.variant_of`."""
    outcome = np.asarray(results.outcome)
    arena = np.asarray(scenario.variant_of(np.arange(len(outcome)))) % scenario.count
    games = np.bincount(arena, minlength=scenario.count)
    wins = np.bincount(arena[np.isin(outcome, PURSUER_WINS)], minlength=scenario.count)
    is_played = games > 0
    return ByArena(tuple(wins[is_played].tolist()), tuple(games[is_played].tolist()))


DETOURS = {"below 1.5": (0.0, 1.5), "1.5 to 2.5": (1.5, 2.5), "above 2.5": (2.5, np.inf)}
"""Classes of starts, by the shortest way between the robots over the straight line."""


def count_by_detour(
    detours: Float[np.ndarray, " games"], results: Results
) -> dict[str, tuple[int, int]]:
    """Count the pursuer's wins and the games of each class of starts; starts without a path are in
    no class.
    """
    is_win = np.isin(np.asarray(results.outcome), PURSUER_WINS)
    counts = dict[str, tuple[int, int]]()
    for name, (least, most) in DETOURS.items():
        in_class = (detours >= least) & (detours < most)
        counts[name] = int(np.sum(is_win & in_class)), int(np.sum(in_class))
    return counts


@dataclass(frozen=True)
class SightingCounts:
    """Games in which a side with sensors saw an opponent, the median of steps until then, and the
    share of steps.
    """

    games: int
    first_steps: float | None
    share: float


def count_sightings(results: Results) -> dict[str, SightingCounts] | None:
    """Count the sightings of each side with sensors, by its name; None if no side has any."""

    def of_side(sightings: Sightings) -> SightingCounts:
        first = np.asarray(sightings.first)
        first = first[first >= 0]
        median = float(np.median(first)) if len(first) else None
        share = float(np.sum(sightings.steps) / np.sum(results.steps))
        return SightingCounts(len(first), median, share)

    sides = zip(Role, results.sightings or (), strict=False)
    return {role.name.lower(): of_side(sightings) for role, sightings in sides if sightings} or None


@dataclass(frozen=True)
class MatchResult:
    """The results of a match: counts of outcomes, rates in [0, 1] with Wilson 95 % intervals, mean
    lengths.
    """

    outcomes: dict[str, int]
    """Games by outcome: the rows of Tables II and III, plus `both_failed`."""
    mean_steps: float
    mean_capture_steps: float | None
    """Over the captured games; None if there are none."""
    time_limit_wins: bool = False
    """True if the rules count a game that reached the time limit as the evader's win."""
    arenas: ByArena | None = None
    """The same match by arenas, where there are several."""
    detours: dict[str, tuple[int, int]] | None = None
    """The pursuer's wins and the games of each class of `DETOURS`, in several arenas with charts.
    """
    sight: dict[str, SightingCounts] | None = None
    """Sightings by each side with sensors."""
    unpromised: dict[str, int] | None = None
    """Starts from which a side's shield promises nothing; None where it promises from all."""
    robots: dict[str, dict[str, int]] | None = None
    """Robots of each side by their status at the end, in a game of teams."""

    @property
    def games(self) -> int:
        """The number of games."""
        return sum(self.outcomes.values())

    @property
    def pursuer_wins(self) -> int:
        """Games that ended in a capture, or by a failure of the evader alone."""
        return sum(self.outcomes[name] for name in names_of(PURSUER_WINS))

    @property
    def evader_wins(self) -> int:
        """Games that ended by a failure of the pursuer alone, or at the time limit where the rules
        count that.
        """
        names = names_of(evader_winning(self.time_limit_wins))
        return sum(self.outcomes.get(name, 0) for name in names)

    @property
    def pursuer_win_rate(self) -> float:
        """Share of games that the pursuer won."""
        return self.pursuer_wins / self.games

    @property
    def pursuer_win_interval(self) -> tuple[float, float]:
        """Interval of that rate."""
        return wilson_interval(self.pursuer_wins, self.games)

    @property
    def evader_win_rate(self) -> float:
        """Share of games that the evader won."""
        return self.evader_wins / self.games

    @property
    def evader_win_interval(self) -> tuple[float, float]:
        """Interval of that rate."""
        return wilson_interval(self.evader_wins, self.games)

    @property
    def evader_undefeated_rate(self) -> float:
        """Share of games that were neither the pursuer's wins nor double failures (Fig. 6)."""
        return (self.games - self.pursuer_wins - self.outcomes["both_failed"]) / self.games

    def to_dict(self) -> dict[str, Any]:
        """Return the result as JSON-like data, without the fields of several arenas, sensors,
        shields and teams where they are None.
        """
        derived = {name: getattr(self, name) for name in _DERIVED}
        data = {"games": self.games} | asdict(self) | derived
        return {
            name: value
            for name, value in data.items()
            if name not in ("arenas", "detours", "sight", "unpromised", "robots")
            or value is not None
        }


_DERIVED = (
    "pursuer_win_rate",
    "pursuer_win_interval",
    "evader_win_rate",
    "evader_win_interval",
    "evader_undefeated_rate",
)
"""Figures that follow from the counts, written beside them for other programs."""


def read_result(data: Any, source: str) -> MatchResult:
    """Return the result of a match from what `MatchResult.to_dict` wrote; raises InvalidInput for
    anything else.
    """
    require(isinstance(data, dict), source, data, "the result of a match")
    own = {field.name: data[field.name] for field in fields(MatchResult) if field.name in data}
    result = from_dict(MatchResult, own, source)
    require_counts(result.outcomes, source)
    require(result.games > 0, f"{source}: games", result.games, "1 at least")
    return result
