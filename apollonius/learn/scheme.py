"""Schemes of self-play: whom the learning sides meet, and the numbers of it."""

from dataclasses import dataclass
from typing import Literal

from apollonius.errors import require, require_positive

Scheme = Literal[
    "latest",
    "alternating",
    "uniform",
    "latest-80-20",
    "prioritised-hard",
    "prioritised-even",
    "gated",
    "psro",
    "psro-hedge",
    "league",
]

_SHARES = {"latest": 0.0, "alternating": 0.0, "latest-80-20": 0.2, "psro": 1.0, "psro-hedge": 1.0}
"""Share of the games with an earlier version, where the scheme itself says it."""


@dataclass(frozen=True)
class OpponentConfig:
    """Whom the sides of self-play meet (`apollonius.learn.opponents`)."""

    scheme: Scheme = "latest"
    """`latest`: each other, as in Algorithm 2. `alternating`: each other, and only one of them learns at a time. The
    rest: in a share of the games an earlier version, drawn by the scheme."""
    past_share: float = 0.5
    """Share of the games with an earlier version, half of them of either side; `latest-80-20` has 0.2, `psro` 1."""
    versions: int = 16
    """Earlier versions kept of each side, taken evenly over the stage; with `league` half of them are exploiters."""
    seats: int = 8
    """Earlier versions of each side that play at a time."""
    renewal: int = 524_288
    """Env steps between two draws of who plays; with `alternating`, between two changes of who learns. Versions are
    judged by games that can last to the time limit before the next draw, so it must leave that time."""
    payoff_games: int = 32
    """Games of every version with every version of the other side, where the scheme asks who beats whom."""
    margin: float = 0.05
    """With `gated`: how much more of these games than its predecessor a new version must win to be kept."""
    exploiter_seats: int = 2
    """With `league`: how many of either side's seats its exploiter has."""

    def __post_init__(self) -> None:
        require_positive(self, "versions", "seats", "renewal", "payoff_games", "exploiter_seats")
        require(0 < self.past_share <= 1, "past_share", self.past_share, "more than 0 and at most 1")
        require(0 <= self.margin < 1, "margin", self.margin, "at least 0 and less than 1")
        fewer = self.scheme != "league" or self.exploiter_seats < self.seats
        require(fewer, "exploiter_seats", self.exploiter_seats, f"less than seats = {self.seats}")

    @property
    def share(self) -> float:
        """Share of the games with an earlier version."""
        return _SHARES.get(self.scheme, self.past_share)

    @property
    def keeps_records(self) -> bool:
        """Whether versions are drawn by how they fare against the other side's learner."""
        return self.scheme in ("latest-80-20", "prioritised-hard", "prioritised-even", "league")

    @property
    def keeps_payoffs(self) -> bool:
        """Whether the versions of both sides play each other, to know who beats whom."""
        return self.scheme in ("gated", "psro", "psro-hedge")

    @property
    def has_exploiters(self) -> bool:
        """Whether either side has an exploiter: a second learner that only meets the other side's first."""
        return self.scheme == "league"

    @property
    def version_seats(self) -> int:
        """Seats of either side that earlier versions have; the last ones are the exploiter's."""
        return self.seats - (self.exploiter_seats if self.has_exploiters else 0)

    @property
    def entrants(self) -> int:
        """Versions of either side that enter at a time: its learner, and its exploiter."""
        return 2 if self.has_exploiters else 1
