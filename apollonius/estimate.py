"""How far a work of several pieces is, and how long the rest will take."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

_ENOUGH_SECONDS = 1.5
"""Time after which a piece's own speed is believed."""
_MANY = 5
"""Reports after which the longest time between two of them is taken to be as long as the mean of the others."""


@dataclass
class _Piece:
    """A piece of the work: its amount, when it began, and how far it was when."""

    what: str
    amount: float
    begun: float | None = None
    first: tuple[float, float] | None = None
    """Time and amount done at the first report; what went before was preparation, such as compiling."""
    last: tuple[float, float] | None = None
    longest: float = 0.0
    """The longest time between two reports; something was likely compiled then, once."""
    reports: int = 0

    def report(self, now: float, done: int | float) -> None:
        """So much is done now."""
        if self.first is None or self.last is None or done <= 0:
            self.first = (now, done)
        else:
            self.longest, self.reports = max(self.longest, now - self.last[0]), self.reports + 1
        self.last = (now, done)

    @property
    def done(self) -> float:
        return self.last[1] if self.last else 0.0

    @property
    def speed(self) -> float | None:
        """Amount per second, once that can be said."""
        if self.first is None or self.last is None or self.last[0] - self.first[0] < _ENOUGH_SECONDS:
            return None
        seconds = self.last[0] - self.first[0]
        if self.reports >= _MANY:
            seconds = (seconds - self.longest) * self.reports / (self.reports - 1)
        return (self.last[1] - self.first[1]) / seconds or None

    @property
    def preparation(self) -> float | None:
        """Seconds from its beginning to the first report."""
        return self.first[0] - self.begun if self.first and self.begun is not None else None


class Estimate:
    """One estimate over all pieces of a work. What has not begun yet is taken to go as what has.

    Args:
        clock: the time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._begun = clock()
        self._pieces: list[_Piece] = []
        self._current = -1

    def plan(self, pieces: Mapping[str, int | float]) -> None:
        """Say which pieces there will be.

        Args:
            pieces: by name, the amount of each, in one unit for all.
        """
        self._pieces = [_Piece(what, float(amount)) for what, amount in pieces.items()]
        self._current = -1

    def begin(self, what: str) -> None:
        """Begin a piece; those planned before it are over. One that was not planned is the only one."""
        names = [piece.what for piece in self._pieces]
        if what not in names:
            self.plan({what: 1.0})
            names = [what]
        self._current = names.index(what)
        self._pieces[self._current].begun = self._clock()

    def report(self, done: int | float, total: int | float) -> None:
        """Say how much of the piece is done, in any unit."""
        piece = self._pieces[self._current]
        piece.report(self._clock(), piece.amount * min(1.0, done / total))

    @property
    def what(self) -> str | None:
        """The piece that goes on; None before the first."""
        return self._pieces[self._current].what if self._current >= 0 else None

    @property
    def reported(self) -> bool:
        """Whether the piece that goes on has reported."""
        return self._current >= 0 and self._pieces[self._current].first is not None

    @property
    def seconds(self) -> float:
        """Time since the beginning of everything."""
        return self._clock() - self._begun

    @property
    def piece_seconds(self) -> float:
        """Time since the piece that goes on began."""
        begun = self._pieces[self._current].begun if self._current >= 0 else None
        return self._clock() - (self._begun if begun is None else begun)

    @property
    def share(self) -> float | None:
        """How much of the whole is done, from 0 to 1; None before anything was reported."""
        if self._current < 0 or (self._current == 0 and self._pieces[0].first is None):
            return None
        before = sum(piece.amount for piece in self._pieces[: self._current])
        whole = sum(piece.amount for piece in self._pieces)
        return min(1.0, (before + self._pieces[self._current].done) / whole)

    @property
    def left(self) -> float | None:
        """Seconds to the end of the last piece; None as long as nothing can be said."""
        if self._current < 0:
            return None
        seen = self._pieces[: self._current + 1]
        speeds = [piece.speed for piece in seen if piece.speed]
        if not speeds:
            return None
        preparation = max((piece.preparation for piece in seen if piece.preparation is not None), default=0.0)
        current = seen[-1]
        seconds = (current.amount - current.done) / (current.speed or speeds[-1])
        if current.first is None:
            seconds += max(0.0, preparation - self.piece_seconds)
        elif current.last is not None:  # count down between reports, but never to nothing
            seconds = max(seconds / 2, seconds - (self._clock() - current.last[0]))
        for piece in self._pieces[self._current + 1 :]:
            seconds += piece.amount / speeds[-1] + preparation
        return max(0.0, seconds)
