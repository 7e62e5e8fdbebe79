"""What a person sees while a command works: what it does, how far it is, how long it will take.

All of it goes to standard error: a live bar where that is a terminal, else a plain line now and then. Nothing here
takes long to import, so that something can be said before JAX is there.
"""

import sys
import threading
import time
from collections.abc import Callable, Mapping
from types import TracebackType

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from apollonius.errors import InvalidInput
from apollonius.estimate import Estimate
from apollonius.interrupts import before_leaving

_FIRST_SECONDS = 0.7
"""What takes no longer than this says nothing where the output is piped."""
_NEXT_SECONDS = 10.0
"""Time between two plain lines about the same piece of work."""
_LOOKS_A_SECOND = 4


class Display:
    """Shows how a command gets on. Use as a context manager around all that it does.

    What is printed meanwhile stands above the live bar where standard output is a terminal too.

    Args:
        command: the name that plain lines begin with.
    """

    def __init__(self, command: str) -> None:
        self.estimate = Estimate()
        self._command = command
        self._notes: Mapping[str, str] = {}
        self._poll: Callable[[], tuple[float, float]] | None = None
        self._compiles = False
        self._console = Console(stderr=True)
        self._bar = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[left]}"),
            TimeElapsedColumn(),
            console=self._console,
            disable=True,  # the live view below draws it
        )
        self._task = self._bar.add_task("loading", total=None, left="")
        self._live: Live | None = None
        self._lines: _PlainLines | None = None

    def __enter__(self) -> "Display":
        if self._console.is_terminal:
            self._live = Live(
                console=self._console, get_renderable=self._screen, transient=True,
                redirect_stdout=sys.stdout.isatty(), refresh_per_second=_LOOKS_A_SECOND,
            )  # fmt: skip
            self._live.start(refresh=True)
        else:
            self._lines = _PlainLines(self, f"apollonius {self._command}: ")
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
        if self._live:
            self._live.stop()
        if self._lines:
            self._lines.stop(finish_line)

    def plan(self, pieces: Mapping[str, int | float]) -> None:
        """Say beforehand which pieces of work there are, and about how much each takes, in a unit of one's own."""
        self.estimate.plan(pieces)

    def begin(self, what: str, compiles: bool = False, poll: Callable[[], tuple[float, float]] | None = None) -> None:
        """Begin a piece of work, planned or not.

        Args:
            what: which, in words.
            compiles: whether it has to be compiled before it can report.
            poll: asked now and then how far it is, where the piece does not report by itself.
        """
        self._poll, self._notes, self._compiles = poll, {}, compiles
        self.estimate.begin(what)

    def report(self, done: int | float, total: int | float) -> None:
        """Say how much of the piece is done."""
        self.estimate.report(done, total)

    def note(self, notes: Mapping[str, str]) -> None:
        """Say more about the piece, in words by name."""
        self._notes = notes

    def tell(self, line: str) -> None:
        """A line that stays, on standard error."""
        if self._lines:
            self._lines.write(line)
        else:
            self._console.print(line, markup=False, highlight=False, soft_wrap=True)

    def state(self) -> str:
        """How it stands, in words."""
        self._ask()
        left, share = self.estimate.left, self.estimate.share
        parts = [self._words()]
        parts += [f"{share:.1%}"] if share is not None else []
        parts += [f"{duration(left)} left"] if left is not None else [f"{duration(self.estimate.seconds)} so far"]
        parts += [f"{name} {value}" for name, value in self._notes.items()]
        return ", ".join(parts)

    def _words(self) -> str:
        """What goes on."""
        what = self.estimate.what or "loading"
        return f"{what} (compiling)" if self._compiles and not self.estimate.reported else what

    def _ask(self) -> None:
        if self._poll:
            self.estimate.report(*self._poll())

    def _screen(self) -> RenderableType:
        """The live view."""
        self._ask()
        left, share = self.estimate.left, self.estimate.share
        self._bar.update(
            self._task,
            description=self._words(),
            total=None if share is None else 1.0,
            completed=share or 0.0,
            left="" if left is None else f"{duration(left)} left,",
        )
        notes = Table(show_header=False, box=None, pad_edge=False)
        for name, value in self._notes.items():
            notes.add_row(f"  {name}", value)
        return Group(self._bar, notes) if self._notes else self._bar


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
        """A whole line."""
        with self._lock:
            self._put(f"{self._rest}{line}\n")
            self._rest, self._said_at = "", time.monotonic()

    def write_open(self, words: str) -> None:
        """Words that go on in the same line until something is reported: a refusal may still follow."""
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
        while not self._over.wait(1 / _LOOKS_A_SECOND):
            estimate = self._display.estimate
            what = estimate.what or "loading"
            is_new = self._said not in (None, what) and estimate.piece_seconds >= _FIRST_SECONDS
            if is_new or time.monotonic() - self._said_at >= _NEXT_SECONDS:
                self._said = what
                if estimate.reported:
                    self.write(f"{self._prefix}{self._display.state()}")
                else:
                    self.write_open(self._display.state())

    def _put(self, text: str) -> None:
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):  # nobody reads any more
            self._over.set()


def duration(seconds: float) -> str:
    """Hours, minutes and seconds."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}"
