"""Progress of a command and its time left, on standard error: a live bar in a terminal, else a line every 10 s.

Nothing here takes long to import, so that the bar is there before JAX.
"""

import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from types import TracebackType

from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task, TaskProgressColumn
from rich.table import Table
from rich.text import Text

from apollonius.io.interrupts import before_leaving

_LINE_SECONDS = 10.0
"""Time between two plain lines."""
_DRAWN_PER_SECOND = 4
_SPEED_SECONDS = 600.0
"""Time over which speed is measured: trainings and sweeps may report once a minute."""
_ENOUGH_SECONDS = 1.5
"""Time after which a speed is believed."""


class Display(Progress):
    """The progress of a command, as a context manager around all its work.

    In a terminal, output that is printed meanwhile stands above the live bar.

    Args:
        command: the name that plain lines begin with.
        get_time: returns the time [s].
    """

    def __init__(self, command: str, get_time: Callable[[], float] = time.monotonic) -> None:
        self.what: str | None = None
        """The present piece of work; None before the first."""
        self._began = self._first = self._last = get_time()
        """Times of the beginning, and of the first and last report of the present piece."""
        self._reported = self._compiles = False
        self._notes: Mapping[str, str] = {}
        self._poll: Callable[[], tuple[float, float]] | None = None
        self._pieces: Mapping[str, int | float] = {}
        self._command, self._over = command, threading.Event()
        columns = _Words(self._words), BarColumn(), TaskProgressColumn(), _Words(self._left), _Words(self._elapsed)
        super().__init__(
            SpinnerColumn(), *columns, console=Console(stderr=True), transient=True, get_time=get_time,
            redirect_stdout=sys.stdout.isatty(), refresh_per_second=_DRAWN_PER_SECOND,
            speed_estimate_period=_SPEED_SECONDS,
        )  # fmt: skip
        self._task = self.add_task("", total=None)

    def __enter__(self) -> "Display":
        if self.console.is_terminal:
            self.start()
        else:
            threading.Thread(target=self._write_lines, daemon=True).start()
        before_leaving(self.end)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()
        before_leaving()

    def end(self) -> None:
        """Show no more, before results are printed."""
        self._over.set()
        if self.live.is_started:
            self.stop()

    def _write_lines(self) -> None:
        while not self._over.wait(_LINE_SECONDS):
            if self._reported:  # a refusal, which comes before, is the only line
                self.tell(f"apollonius {self._command}: {self.state()}")

    def plan(self, pieces: Mapping[str, int | float]) -> None:
        """Set the pieces of work beforehand, each with about its amount, in any unit."""
        self._pieces = dict(pieces)

    def begin(self, what: str, compiles: bool = False, poll: Callable[[], tuple[float, float]] | None = None) -> None:
        """Begin a piece of work; those planned before it are over. One that was not planned is the only one.

        Args:
            what: the piece, in words.
            compiles: whether it has to be compiled before it can report.
            poll: returns the amount done and the whole amount, for a piece that does not report by itself.
        """
        if what not in self._pieces:
            self.plan({what: 1.0})
        self.what, self._poll, self._notes, self._compiles = what, poll, {}, compiles
        self._reported = False
        before, whole = self._amounts()
        self.reset(self._task)
        task = self.tasks[0]
        task.total = whole if before else None
        task.completed = before - 1e-9 * whole  # so that a first report counts, even one of nothing

    def report(self, done: int | float, total: int | float) -> None:
        """Set how much of the piece is done, in any unit."""
        before, whole = self._amounts()
        completed = before + (self._pieces[self.what] if self.what else 0.0) * min(1.0, done / total)
        if completed == self.tasks[0].completed:
            return
        self._last = self.get_time()
        if not self._reported:
            self._reported, self._first = True, self._last
        self.update(self._task, total=whole, completed=completed)

    def note(self, notes: Mapping[str, str]) -> None:
        """Set further facts about the piece, in words by name."""
        self._notes = notes

    def tell(self, line: str) -> None:
        """Print a line that stays, on standard error."""
        self.console.print(line, markup=False, highlight=False, soft_wrap=True)

    def state(self) -> str:
        """Return the progress in words."""
        self._ask()
        task = self.tasks[0]
        share = [] if task.total is None else [f"{task.percentage:.1f}%"]
        clock = self._left(task) or f"{self._elapsed(task)} so far"
        notes = (f"{name} {value}" for name, value in self._notes.items())
        return ", ".join([self._words(task), *share, clock, *notes])

    def get_renderables(self) -> Iterable[RenderableType]:
        """Yield the live view."""
        self._ask()
        yield self.make_tasks_table(self.tasks)
        if self._notes:
            notes = Table(show_header=False, box=None, pad_edge=False)
            for name, value in self._notes.items():
                notes.add_row(f"  {name}", value)
            yield notes

    def _amounts(self) -> tuple[float, float]:
        """Return the amount before the present piece, and the whole."""
        amounts = list(self._pieces.values())
        return float(sum(amounts[: list(self._pieces).index(self.what)] if self.what else ())), float(sum(amounts))

    def _ask(self) -> None:
        if self._poll:
            self.report(*self._poll())

    def _words(self, task: Task) -> str:
        return f"{self.what or 'loading'}{' (compiling)' if self._compiles and not self._reported else ''}"

    def _left(self, task: Task) -> str:
        """Return the time left, counted down between reports; nothing while it is unknown, or when it is over."""
        if self._last - self._first < _ENOUGH_SECONDS or not task.speed or task.remaining is None:
            return ""
        left = task.remaining / task.speed - (self.get_time() - self._last)
        return f"{duration(left)} left" if self._reported and left >= 1 else ""

    def _elapsed(self, task: Task) -> str:
        return duration(self.get_time() - self._began)


class _Words(ProgressColumn):
    """A column of words about the task."""

    def __init__(self, words: Callable[[Task], str]) -> None:
        super().__init__()
        self._words = words

    def render(self, task: Task) -> Text:
        """Return the column's text."""
        return Text(self._words(task))


def duration(seconds: float) -> str:
    """Return hours, minutes and seconds."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}"
