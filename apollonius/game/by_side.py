"""One value for each side of the game, so that rules for both are written once."""

from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

import equinox as eqx

from apollonius.io.errors import require

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
U = TypeVar("U")


class BySide(eqx.Module, Generic[T_co]):
    """One value for each side, indexed by `Role`: `values[role]`, and `values[role.other]` for the opponent's.

    The values of a side's robots are a tuple: `BySide[tuple[RobotState, ...]]`.
    """

    pursuer: T_co
    evader: T_co

    @classmethod
    def of(cls, role: int, own: U, other: U) -> "BySide[U]":
        """Return the values of a side, a `Role`, and of its opponents."""
        return BySide(other, own) if role else BySide(own, other)

    def __getitem__(self, role: int) -> T_co:
        return (self.pursuer, self.evader)[role]

    def __iter__(self) -> Iterator[T_co]:
        return iter((self.pursuer, self.evader))

    def map(self, function: Callable[[T_co], U]) -> "BySide[U]":
        return BySide(function(self.pursuer), function(self.evader))


def one_each(robots: BySide[tuple[T, ...]]) -> BySide[T]:
    """Return the values of the two robots of a game of two; raises InvalidInput for other numbers of robots."""
    counts = " v ".join(str(len(side)) for side in robots)
    require(counts == "1 v 1", "robots", counts, "1 v 1: this is known for games of two robots only")
    return robots.map(lambda side: side[0])
