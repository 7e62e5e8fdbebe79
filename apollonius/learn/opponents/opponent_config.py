"""Whom the sides of self-play meet: the scheme, and the numbers of it."""

from dataclasses import dataclass

from apollonius.errors import require, require_positive
from apollonius.learn.opponents.scheme import AbstractScheme, find_scheme
from apollonius.learn.opponents.schemes import SCHEMES


@dataclass(frozen=True)
class OpponentConfig:
    """Whom the sides of self-play meet (`apollonius.learn.opponents`)."""

    scheme: str = "latest"
    """`latest`: each other, as in Algorithm 2. The rest: in a share of the games an earlier version, drawn by the
    scheme."""
    past_share: float = 0.5
    """Share of the games with an earlier version, half of them of either side, where the scheme does not say it."""
    versions: int = 16
    """Earlier versions kept of each side, taken evenly over the stage."""
    seats: int = 8
    """Earlier versions of each side that play at a time."""
    renewal: int = 524_288
    """Env steps between two draws of who plays. Versions are judged by games that can last to the time limit before the
    next draw, so it must leave that time."""

    def __post_init__(self) -> None:
        require(self.scheme in SCHEMES, "scheme", self.scheme, f"one of {', '.join(SCHEMES)}")
        require_positive(self, "versions", "seats", "renewal")
        require(0 < self.past_share <= 1, "past_share", self.past_share, "more than 0 and at most 1")

    @property
    def rule(self) -> AbstractScheme:
        """What the scheme decides."""
        return find_scheme(self.scheme)

    @property
    def share(self) -> float:
        """Share of the games with an earlier version."""
        said = self.rule.share
        return self.past_share if said is None else said
