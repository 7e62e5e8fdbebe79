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

_going_on = ""
_shown: list[Callable[[], None]] = []
_answered = threading.Event()
_heard: list[int] = []
_asked: list[int] = []
_parent: int | None = None
_leaving = threading.Lock()


def go_on(how: str) -> None:
    """Set the words for resuming that are printed if the program is stopped from now on."""
    global _going_on
    _going_on = how


def before_leaving(*take_down: Callable[[], None]) -> None:
    """Set the functions that are called before the last line is printed, as to take down a live
    view.
    """
    _shown[:] = take_down


def stopped() -> str:
    """Return the last line of a program that was stopped."""
    return f"stopped; {_going_on}" if _going_on else "stopped"


def status() -> int | None:
    """Return the exit status of a program that was interrupted; None where it was not."""
    return 128 + _heard[0] if _heard else None


@contextmanager
def asked_to_stop(again: bool = True, parent: int | None = None) -> Generator[None, None, None]:
    """Within the block, let a signal set `asked` instead of interrupting, so that work can be saved
    first.

    Args:
        again: Whether a second signal interrupts.
        parent: Process whose end also sets `asked`.
    """
    global _parent

    def hear(number: int, frame: FrameType | None) -> None:
        _asked.append(number)
        if again and len(_asked) > 1:
            raise KeyboardInterrupt

    before = [(number, signal.signal(number, hear)) for number in SIGNALS]
    _parent = parent
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)
        _asked.clear()


def asked() -> bool:
    """Check whether to stop, within a block of `asked_to_stop`; elsewhere a signal interrupts at
    once.
    """
    if _asked:
        _answered.set()  # so that the listening thread lets the program save its work
    return bool(_asked) or _parent not in (None, os.getppid())


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
        _heard.append(number)
        if not _answered.wait(PATIENCE):
            leave(128 + number, stopped() if says else "")
        write_end.fileno()  # keeps the socket alive as long as this thread

    def hear(number: int, frame: FrameType | None) -> NoReturn:
        _heard.append(number)
        if _is_unfit(frame):
            leave(128 + number, stopped() if says else "")
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
    _leaving.acquire()  # for good: two threads may come here, and one may speak
    try:
        for take_down in _shown:
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
