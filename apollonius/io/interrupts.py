"""Ctrl-C and SIGTERM: a program ends within two seconds, whatever it is doing, and says how to
resume.

A signal raises KeyboardInterrupt, so that temporary files are deleted and other processes end.
Where that does not work the process ends here and now:

- in a compilation, which is a single instruction to Python and may take half a minute; Python
  handles a signal between two instructions, so a thread waits for signals and for their effect;
- while a module is imported: one of C, such as NumPy's, prints a traceback of its own or makes
  another error of it;
- in what runs as memory is freed: Python drops exceptions there.

Results are written atomically, so only the work since the last write is lost. An interrupted
program skips the interpreter's finalisation, where threads of XLA that are still at work would
crash it.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, NoReturn

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells use it."""
SIGNALS = (signal.SIGINT, signal.SIGTERM)
"""All that stop a program: Ctrl-C, and what a system or a scheduler sends."""
PATIENCE = 1.2
"""Time that a program has to end, or to answer [s]."""

_resume_hint = ""
_take_down: list[Callable[[], None]] = []
_handled: list[int] = []
"""All signals that this program has handled."""
_stop_signals: list[int] = []
"""Signals within the present block of `stopping_on_signals`."""
_has_answered = threading.Event()
_parent: int | None = None
_leave_lock = threading.RLock()


def set_resume_hint(how: str) -> None:
    """Set the words for resuming that are printed if the program is stopped from now on."""
    global _resume_hint
    _resume_hint = how


def before_leaving(take_down: Callable[[], None]) -> None:
    """Set the function that is called before the last line is printed, as to take down a live
    view.
    """
    _take_down[:] = [take_down]


def stop_message() -> str:
    """Return the last line of a program that was stopped."""
    return f"stopped; {_resume_hint}" if _resume_hint else "stopped"


def interrupt_status() -> int | None:
    """Return the exit status of a program that was interrupted; None where it was not."""
    return 128 + _handled[0] if _handled else None


@contextmanager
def stopping_on_signals(
    again: bool = True, parent: int | None = None
) -> Generator[None, None, None]:
    """Within the block, report signals by `should_stop` instead of interrupting, so that work can
    be saved first.

    Args:
        again: Whether a second signal interrupts.
        parent: process whose end counts as a signal, too.
    """
    global _parent

    def note(number: int, frame: FrameType | None) -> None:
        _handled.append(number)
        _stop_signals.append(number)
        if again and len(_stop_signals) > 1:
            raise KeyboardInterrupt

    before = [(number, signal.signal(number, note)) for number in SIGNALS]
    _parent = parent
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)
        _stop_signals.clear()
        _parent = None


def should_stop() -> bool:
    """Check whether to stop, within a block of `stopping_on_signals`; elsewhere a signal interrupts
    at once.
    """
    if _stop_signals:
        _has_answered.set()  # so that the listening thread lets the program save its work
    return bool(_stop_signals) or _parent not in (None, os.getppid())


def listen(says: bool = True) -> None:
    """Stop this process on signals from now on; it `says` a last line. To be called once, in the
    main thread.
    """

    def leave_after(number: int) -> NoReturn:
        leave(128 + number, stop_message() if says else "")

    def interrupt(number: int, frame: FrameType | None) -> NoReturn:
        _handled.append(number)
        if _is_importing(frame):
            leave_after(number)
        raise KeyboardInterrupt

    def drop(exception: Any) -> None:
        if exception.exc_type is KeyboardInterrupt:
            leave_after(_handled[0])
        sys.__unraisablehook__(exception)

    read_end, write_end = os.pipe()
    os.set_blocking(write_end, False)

    def wait() -> None:
        number = os.read(read_end, 1)[0]
        while number not in SIGNALS:  # but others that a library handles
            number = os.read(read_end, 1)[0]
        if not _has_answered.wait(PATIENCE):
            leave_after(number)

    for number in SIGNALS:
        signal.signal(number, interrupt)
    signal.set_wakeup_fd(write_end)
    sys.unraisablehook = drop
    threading.Thread(target=wait, name="signals", daemon=True).start()


def _is_importing(frame: FrameType | None) -> bool:
    while frame and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    return frame is not None


def leave(status: int, words: str = "") -> NoReturn:
    """End the process here and now, with what it has printed and a last line on standard error."""
    _leave_lock.acquire()  # for good: two threads may come here, and one may speak

    def speak() -> None:
        if words:
            print(words, file=sys.stderr)

    for step in (*_take_down, speak, sys.stdout.flush):
        with suppress(BaseException):  # as where the reader of the output is gone
            step()
    os._exit(status)
