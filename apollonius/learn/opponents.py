"""Schemes of self-play: how opponents are drawn from the earlier versions of the other side. Free
of JAX.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from apollonius.io.errors import require, require_positive, require_within

SCHEMES: dict[str, Callable[[Any], Any] | None] = {
    "latest": None,
    "uniform": lambda lost: lost**0,
    "prioritised-hard": lambda lost: (1 - lost) ** 2,
}
"""Weights of the earlier versions of the other side, from the share of its recent games that each
lost to the learner.

`latest`: only each other, Algorithm 2 of the paper. `uniform`: fictitious self-play (Heinrich,
Lanctot, Silver, 2015). `prioritised-hard`: the more likely, the harder to beat, AlphaStar's f_hard
(Vinyals et al., 2019).
"""


@dataclass(frozen=True)
class OpponentConfig:
    """The opponents of both sides in self-play."""

    scheme: str = "latest"
    """`latest`: each other, as in Algorithm 2. Others: an earlier version in a share of the games.
    """
    past_share: float = 0.5
    """Share of the games with an earlier version, half with one of either side, unless the scheme
    is `latest`.
    """
    versions: int = 16
    """Earlier versions kept of each side, taken evenly over the stage."""
    slots: int = 8
    """Earlier versions of each side that play at a time."""
    renewal: int = 524_288
    """Env steps between two draws of opponents. Versions are judged by games that can last to the
    time limit before the next draw, so it must leave that time.
    """

    def __post_init__(self) -> None:
        require(self.scheme in SCHEMES, "scheme", self.scheme, f"one of {', '.join(SCHEMES)}")
        require_positive(self, "versions", "slots", "renewal", "past_share")
        require_within(self, 0, 1, "past_share")

    @property
    def share(self) -> float:
        """Share of the games with an earlier version."""
        return 0.0 if SCHEMES[self.scheme] is None else self.past_share

    def slot_games(self, games: int) -> int:
        """Return the number of games of a batch that belong to one slot."""
        return int(self.share * games) // (2 * self.slots)

    def first_game(self, role: int, games: int) -> int:
        """Return the first game of a batch that belongs to a slot of a side: earlier pursuers sit
        before evaders.
        """
        return role * self.slots * self.slot_games(games)
