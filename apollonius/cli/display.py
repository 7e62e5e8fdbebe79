"""Progress of a command and its time left, on standard error: a live bar in a terminal, else a line every 10 s."""

import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from datetime import timedelta

from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from apollonius.io.errors import LONGEST_MESSAGE, shown
from apollonius.io.interrupts import before_leaving

_LINE_SECONDS = 10.0
"""Time between two plain lines."""
_SPEED_SECONDS = 600.0
"""Time over which speed is measured: trainings and sweeps may report once a minute."""


class Display(Progress):
    """The progress of a command, as a context manager around all its work; plain lines begin with its name."""

    def __init__(self, command: str, get_time: Callable[[], float] = time.monotonic) -> None:
        self._command, self._over, self._what = command, threading.Event(), "loading"
        self._notes: Mapping[str, str] = {}
        columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
        super().__init__(
            SpinnerColumn(), *columns, console=Console(stderr=True), transient=True, get_time=get_time,
            redirect_stdout=sys.stdout.isatty(), refresh_per_second=4, speed_estimate_period=_SPEED_SECONDS,
        )  # fmt: skip
        self._task = self.add_task(self._what, total=None)

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

    def begin(self, what: str, compiles: bool = False) -> None:
        """Begin a piece of work, in words; one that `compiles` first cannot report before that is done."""
        self._what, self._notes = what, {}
        self.reset(self._task, total=None, description=f"{what} (compiling)" if compiles else what)
        self.tasks[0].total = None  # which `reset` leaves as it was

    def report(self, done: int | float, total: int | float) -> None:
        """Set how much of the piece is done, in any unit."""
        self.update(self._task, total=total, completed=done, description=self._what)

    def note(self, notes: Mapping[str, str]) -> None:
        """Set further facts about the piece, in words by name."""
        self._notes = notes

    def tell(self, line: str) -> None:
        """Print one line that stays, whatever is in it, on standard error."""
        self.console.print(shown(line, LONGEST_MESSAGE), markup=False, highlight=False, soft_wrap=True)

    def state(self) -> str:
        """Return the progress in words."""
        task = self.tasks[0]
        left = [] if task.time_remaining is None else [f"{timedelta(seconds=task.time_remaining)} left"]
        notes = (f"{name} {value}" for name, value in self._notes.items())
        return ", ".join([task.description, f"{task.percentage:.1f}%", *left, *notes])

    def get_renderables(self) -> Iterable[RenderableType]:
        """Yield the live view."""
        yield self.make_tasks_table(self.tasks)
        if self._notes:
            notes = Table(show_header=False, box=None, pad_edge=False)
            for name, value in self._notes.items():
                notes.add_row(f"  {name}", value)
            yield notes

    def _write_lines(self) -> None:
        while not self._over.wait(_LINE_SECONDS):
            if self.tasks[0].total is not None:  # a refusal, which comes before the first report, is the only line
                self.tell(f"apollonius {self._command}: {self.state()}")
