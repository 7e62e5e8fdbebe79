"""Ctrl-C and SIGTERM: a program ends within two seconds, whatever it is doing, and says how to
resume.

Python handles a signal between two of its own instructions, and a compilation is a single
instruction that may take half a minute. So a second thread waits for signals and ends the program
if it does not answer in time. Results are written atomically, so only the work since the last write
is lost. An interrupted program skips the interpreter's finalisation, where threads of XLA that are
still at work would crash it.
"""

import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells use it."""
SIGNALS = (signal.SIGINT, signal.SIGTERM)
"""All that stop a program: Ctrl-C, and what a system or a scheduler sends."""
PATIENCE = 1.2
"""How long a program has to answer [s]."""
_SHOW_CURSOR = "\x1b[?25h"

_resume_hint = ""
_take_down: list[Callable[[], None]] = []
_has_answered = threading.Event()
_received: list[int] = []
_stop_signals: list[int] = []
_parent: int | None = None
_leave_lock = threading.Lock()


def set_resume_hint(how: str) -> None:
    """Set the words for resuming that are printed if the program is stopped from now on."""
    global _resume_hint
    _resume_hint = how


def before_leaving(*take_down: Callable[[], None]) -> None:
    """Set the functions that are called before the last line is printed, as to take down a live
    view.
    """
    _take_down[:] = take_down


def stop_message() -> str:
    """Return the last line of a program that was stopped."""
    return f"stopped; {_resume_hint}" if _resume_hint else "stopped"


def interrupt_status() -> int | None:
    """Return the exit status of a program that was interrupted; None where it was not."""
    return 128 + _received[0] if _received else None


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

    def hear(number: int, frame: FrameType | None) -> None:
        _stop_signals.append(number)
        if again and len(_stop_signals) > 1:
            raise KeyboardInterrupt

    before = [(number, signal.signal(number, hear)) for number in SIGNALS]
    _parent = parent
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)
        _stop_signals.clear()


def should_stop() -> bool:
    """Check whether to stop, within a block of `stopping_on_signals`; elsewhere a signal interrupts
    at once.
    """
    if _stop_signals:
        _has_answered.set()  # so that the listening thread lets the program save its work
    return bool(_stop_signals) or _parent not in (None, os.getppid())


def listen(says: bool = True) -> None:
    """End the process where a signal stays unanswered; it `says` a last line. To be called once, in
    the main thread.
    """
    read_end, write_end = socket.socketpair()
    write_end.setblocking(False)
    signal.set_wakeup_fd(write_end.fileno(), warn_on_full_buffer=False)

    def wait() -> None:
        number = read_end.recv(1)[0]
        while number not in SIGNALS:
            number = read_end.recv(1)[0]
        _received.append(number)
        if not _has_answered.wait(PATIENCE):
            leave(128 + number, stop_message() if says else "")
        write_end.fileno()  # keeps the socket alive as long as this thread

    def hear(number: int, frame: FrameType | None) -> NoReturn:
        _received.append(number)
        if _is_unfit(frame):
            leave(128 + number, stop_message() if says else "")
        raise KeyboardInterrupt

    for number in SIGNALS:
        signal.signal(number, hear)
    threading.Thread(target=wait, name="signals", daemon=True).start()


def _is_unfit(frame: FrameType | None) -> bool:
    """Test whether an exception would be unsafe or lost at this point of the program.

    It is unsafe while a module is loaded, which crashes if half loaded, and lost in functions that
    run as memory is freed, whose exceptions Python drops.
    """
    while frame and not frame.f_code.co_filename.startswith("<frozen importlib"):
        if frame.f_code.co_name in ("_xla_gc_callback", "__del__"):
            return True
        frame = frame.f_back
    return frame is not None


def leave(status: int, words: str = "") -> NoReturn:
    """End the process here and now, with what it has printed and a last line on standard error."""
    _leave_lock.acquire()  # for good: two threads may come here, and one may speak
    try:
        for take_down in _take_down:
            take_down()
        if sys.stderr.isatty():
            print(_SHOW_CURSOR, end="", file=sys.stderr)
        if words:
            print(words, file=sys.stderr)
        sys.stderr.flush()
        sys.stdout.flush()
    except (OSError, ValueError):
        pass  # the reader of the output is gone
    os._exit(status)
