"""Progress of a command on standard error: a live bar in a terminal, else plain lines, ever farther
apart.
"""

import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from datetime import timedelta
from itertools import pairwise

from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task, TextColumn
from rich.table import Table
from rich.text import Text

from apollonius.io.compiling import compiling_seconds
from apollonius.io.errors import LONGEST_MESSAGE, format_value
from apollonius.io.interrupts import before_leaving

_FIRST_LINE_SECONDS = 1.0
"""Time after which a piece of work has its first plain line."""
_LOADING_SECONDS = 10.0
"""Time before the first piece of work has a line, so that a refusal is printed alone."""
_LINE_SECONDS = 10.0, 60.0
"""Least and greatest time between two plain lines of a piece; in between it is a third of the
piece's time.
"""
_LOOK_SECONDS = 0.2
"""Time between two looks at whether a line is due."""
_SPEED_SECONDS = 600.0
"""Time over which speed is measured: trainings and sweeps may report once a minute."""
_MEASURED = 2
"""Fewest intervals between reports from which a time left is estimated."""


class Display(Progress):
    """The progress of a command, as a context manager around all its work; plain lines begin with
    its name.
    """

    def __init__(self, command: str, get_time: Callable[[], float] = time.monotonic) -> None:
        self._command, self._over = command, threading.Event()
        self._notes: Mapping[str, str] = {}
        self._share: Callable[[], float] | None = None
        super().__init__(
            SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), _Words(self._words),
            console=Console(stderr=True), transient=True, get_time=get_time,
            redirect_stdout=sys.stdout.isatty(), refresh_per_second=4,
        )  # fmt: skip
        self._task = self.add_task("loading", total=None)
        self.begin_task("loading")
        self._next_line = _LOADING_SECONDS

    def start(self) -> None:
        if self.console.is_terminal:
            super().start()
        else:
            threading.Thread(target=self._write_lines, daemon=True).start()
        before_leaving(self.stop)

    def stop(self) -> None:
        """Show no more, before results are printed."""
        self._over.set()
        if self.live.is_started:
            super().stop()

    def begin_task(self, what: str, share: Callable[[], float] | None = None) -> None:
        """Begin a piece of work, in words; `share` is asked for the part that is done if nobody
        reports it.
        """
        self._notes, self._share = {}, share
        self._start_time = self._polled = self.get_time()
        self._next_line = _FIRST_LINE_SECONDS
        self._reports = deque[tuple[float, float]](maxlen=1_000)
        self.reset(self._task, total=None, description=what)
        self.tasks[0].total = None  # which `reset` leaves as it was

    def report(self, amount: int | float, total: int | float) -> None:
        """Set how much of the piece is done, in any unit."""
        now = self.get_time()
        if self._reports and amount < self._reports[-1][1]:
            self._reports.clear()
        if not self._reports or amount > self._reports[-1][1]:
            self._reports.append((now, amount))
        while len(self._reports) > _MEASURED + 1 and now - self._reports[0][0] > _SPEED_SECONDS:
            self._reports.popleft()
        self.update(self._task, total=total, completed=amount)

    def note(self, notes: Mapping[str, str]) -> None:
        """Set further facts about the piece, in words by name."""
        self._notes = notes

    def print_line(self, line: str) -> None:
        """Print one line that stays, whatever is in it, on standard error."""
        self.console.print(
            format_value(line, LONGEST_MESSAGE), markup=False, highlight=False, soft_wrap=True
        )

    def state(self) -> str:
        """Return the progress in words."""
        notes = (f"{name} {value}" for name, value in self._notes.items())
        return ", ".join([self.tasks[0].description, self._words(), *notes])

    def seconds_left(self) -> float | None:
        """Return the time left by the pace of the reports [s].

        None before enough reports, and while the next one takes unusually long.
        """
        total, reports = self.tasks[0].total, [*self._reports]
        if total is None or len(reports) <= _MEASURED:
            return None
        (first_time, first_amount), (latest, latest_amount) = reports[0], reports[-1]
        silence = self.get_time() - latest
        longest = max(later - time for (time, _), (later, _) in pairwise(reports))
        if silence > max(2 * longest, 1.0):
            return None
        return max(
            0.0,
            (total - latest_amount) * (latest - first_time) / (latest_amount - first_amount)
            - silence,
        )

    def get_renderables(self) -> Iterable[RenderableType]:
        """Yield the live view."""
        self._poll_share()
        yield self.make_tasks_table(self.tasks)
        if self._notes:
            notes = Table(show_header=False, box=None, pad_edge=False)
            for name, value in self._notes.items():
                notes.add_row(f"  {name}", value)
            yield notes

    def _words(self) -> str:
        """Return the share that is done, the time so far and the time left, and the compilation
        under way if any.
        """
        words = [] if self.tasks[0].total is None else [f"{self.tasks[0].percentage:.1f}%"]
        words.append(_clock(self.get_time() - self._start_time))
        seconds_left, compiling = self.seconds_left(), compiling_seconds()
        if seconds_left is not None:
            words.append(f"{_clock(seconds_left)} left")
        if compiling >= 1:
            words.append(f"compiling (once) for {_clock(compiling)}")
        return ", ".join(words)

    def _poll_share(self) -> None:
        """Ask for the share that is done, at most once a second."""
        if self._share and self.get_time() - self._polled >= 1:
            self._polled = self.get_time()
            self.report(self._share(), 1)

    def _write_lines(self) -> None:
        least, greatest = _LINE_SECONDS
        while not self._over.wait(_LOOK_SECONDS):
            age = self.get_time() - self._start_time
            if age >= self._next_line:
                self._next_line = age + min(max(age / 3, least), greatest)
                self._poll_share()
                self.print_line(f"apollonius {self._command}: {self.state()}")


class _Words(ProgressColumn):
    """A column with words that change as time passes."""

    def __init__(self, words: Callable[[], str]) -> None:
        super().__init__()
        self._get_words = words

    def render(self, task: Task) -> Text:
        return Text(self._get_words())


def _clock(seconds: float) -> str:
    return str(timedelta(seconds=round(seconds)))
