"""What a match comes to: counts, rates with their intervals, and lengths of games."""

from dataclasses import asdict, dataclass
from typing import Any

from apollonius.arenas.record import from_dict
from apollonius.errors import require
from apollonius.evaluate.by_arena import ByArena
from apollonius.evaluate.robots import RobotCounts
from apollonius.game.outcome import PURSUER_WINS, names_of, require_counts
from apollonius.limits import MOST_COUNTED


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
