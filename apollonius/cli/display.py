"""What a person sees while a command works: what it does, how far it is, how long it will take.

All of it goes to standard error: a live bar where that is a terminal, else a plain line now and then. Nothing here
takes long to import, so that something can be said before JAX is there.
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

from apollonius.io.errors import InvalidInput
from apollonius.io.interrupts import before_leaving

_FIRST_SECONDS = 0.7
"""What takes no longer than this says nothing where the output is piped."""
_NEXT_SECONDS = 10.0
"""Time between two plain lines about the same piece of work."""
_LOOKS_A_SECOND = 4
_SPEED_SECONDS = 600.0
"""Time over which speed is measured: trainings and sweeps may report once a minute."""
_ENOUGH_SECONDS = 1.5
"""Time after which a speed is believed."""


class Display(Progress):
    """Shows how a command gets on. Use as a context manager around all that it does.

    What is printed meanwhile stands above the live bar where standard output is a terminal too.

    Args:
        command: the name that plain lines begin with.
        get_time: the time [s].
    """

    def __init__(self, command: str, get_time: Callable[[], float] = time.monotonic) -> None:
        self.what: str | None = None
        """The piece of work that goes on; None before the first."""
        self.begun = self._began = get_time()
        """When it began."""
        self._first = self._last = self.begun
        """When it first and last reported."""
        self.reported = self._compiles = False
        self._notes: Mapping[str, str] = {}
        self._poll: Callable[[], tuple[float, float]] | None = None
        self._pieces: Mapping[str, int | float] = {}
        self._prefix = f"apollonius {command}: "
        self._lines: _PlainLines | None = None
        columns = _Words(self._words), BarColumn(), TaskProgressColumn(), _Words(self._left), _Words(self._elapsed)
        super().__init__(
            SpinnerColumn(), *columns, console=Console(stderr=True), transient=True, get_time=get_time,
            redirect_stdout=sys.stdout.isatty(), refresh_per_second=_LOOKS_A_SECOND,
            speed_estimate_period=_SPEED_SECONDS,
        )  # fmt: skip
        self._task = self.add_task("", total=None)

    def __enter__(self) -> "Display":
        if self.console.is_terminal:
            self.start()
        else:
            self._lines = _PlainLines(self, self._prefix)
        before_leaving(self.end)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # A refusal goes on in the line that says what began, so that it stays the only one.
        self.end(finish_line=not isinstance(error, InvalidInput | OSError))
        before_leaving()

    def end(self, finish_line: bool = True) -> None:
        """Show no more, before results are printed."""
        if self._lines:
            self._lines.stop(finish_line)
        elif self.live.is_started:
            self.stop()

    def plan(self, pieces: Mapping[str, int | float]) -> None:
        """Say beforehand which pieces of work there are, and about how much each takes, in a unit of one's own."""
        self._pieces = dict(pieces)

    def begin(self, what: str, compiles: bool = False, poll: Callable[[], tuple[float, float]] | None = None) -> None:
        """Begin a piece of work; those planned before it are over. One that was not planned is the only one.

        Args:
            what: which, in words.
            compiles: whether it has to be compiled before it can report.
            poll: asked now and then how far it is, where the piece does not report by itself.
        """
        if what not in self._pieces:
            self.plan({what: 1.0})
        self.what, self._poll, self._notes, self._compiles = what, poll, {}, compiles
        self.begun, self.reported = self.get_time(), False
        before, whole = self._amounts()
        self.reset(self._task)
        task = self.tasks[0]
        task.total = whole if before else None
        task.completed = before - 1e-9 * whole  # so that a first report counts, even one of nothing

    def report(self, done: int | float, total: int | float) -> None:
        """Say how much of the piece is done, in any unit."""
        before, whole = self._amounts()
        completed = before + (self._pieces[self.what] if self.what else 0.0) * min(1.0, done / total)
        if completed == self.tasks[0].completed:
            return
        self._last = self.get_time()
        if not self.reported:
            self.reported, self._first = True, self._last
        self.update(self._task, total=whole, completed=completed)

    def note(self, notes: Mapping[str, str]) -> None:
        """Say more about the piece, in words by name."""
        self._notes = notes

    def tell(self, line: str) -> None:
        """Print a line that stays, on standard error."""
        if self._lines:
            self._lines.write(line)
        else:
            self.console.print(line, markup=False, highlight=False, soft_wrap=True)

    def state(self) -> str:
        """Return how it stands, in words."""
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
        """Return how much there is before the piece that goes on, and in the whole."""
        amounts = list(self._pieces.values())
        return float(sum(amounts[: list(self._pieces).index(self.what)] if self.what else ())), float(sum(amounts))

    def _ask(self) -> None:
        if self._poll:
            self.report(*self._poll())

    def _words(self, task: Task) -> str:
        return f"{self.what or 'loading'}{' (compiling)' if self._compiles and not self.reported else ''}"

    def _left(self, task: Task) -> str:
        """Return the time left, counted down between reports; nothing where that is not known, or is over."""
        if self._last - self._first < _ENOUGH_SECONDS or not task.speed or task.remaining is None:
            return ""
        left = task.remaining / task.speed - (self.get_time() - self._last)
        return f"{duration(left)} left" if self.reported and left >= 1 else ""

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


class _PlainLines:
    """Writes a line now and then, from a thread of its own, as long as a display goes on."""

    def __init__(self, display: Display, prefix: str) -> None:
        self._display, self._prefix, self._stream = display, prefix, sys.stderr
        self._lock, self._over = threading.RLock(), threading.Event()
        self._rest = ""
        self._said_at, self._said = time.monotonic() - _NEXT_SECONDS + _FIRST_SECONDS, None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def write(self, line: str) -> None:
        """Write a whole line."""
        with self._lock:
            self._put(f"{self._rest}{line}\n")
            self._rest, self._said_at = "", time.monotonic()

    def write_open(self, words: str) -> None:
        """Write words that go on in the same line until something is reported: a refusal may still follow."""
        with self._lock:
            self._put(f"{'' if self._rest else self._prefix}{words} ... ")
            self._rest, self._said_at = "\n", time.monotonic()

    def stop(self, finish_line: bool) -> None:
        """Write no more."""
        self._over.set()
        self._thread.join()
        if finish_line:
            self._put(self._rest)
            self._rest = ""

    def _run(self) -> None:
        display = self._display
        while not self._over.wait(1 / _LOOKS_A_SECOND):
            what = display.what or "loading"
            is_new = self._said not in (None, what) and display.get_time() - display.begun >= _FIRST_SECONDS
            if is_new or time.monotonic() - self._said_at >= _NEXT_SECONDS:
                self._said = what
                state = display.state()
                if display.reported:
                    self.write(f"{self._prefix}{state}")
                else:
                    self.write_open(state)

    def _put(self, text: str) -> None:
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):  # nobody reads any more
            self._over.set()


def duration(seconds: float) -> str:
    """Return hours, minutes and seconds."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}"
