"""Ctrl-C: a program ends within two seconds, whatever it is doing, and says how to go on.

Python tells a program of Ctrl-C between two of its own instructions, and a compilation is a single one that may last
half a minute. So a thread listens beside it: where the program has not answered in time, the thread ends it. All that
matters is written atomically, so nothing is lost but what was done since. A program that was interrupted never goes
through the interpreter's own end, where the threads of XLA that are still at work crash it.
"""

import os
import signal
import socket
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells use it."""
PATIENCE = 1.2
"""How long a program has to answer [s]."""
_SHOW_CURSOR = "\x1b[?25h"

_going_on = ""
_shown: list[Callable[[], None]] = []
_answered = threading.Event()
_heard = threading.Event()
_leaving = threading.Lock()


def go_on(how: str) -> None:
    """Say from here on, to whoever stops the program, how to go on from what it has written."""
    global _going_on
    _going_on = how


def before_leaving(*take_down: Callable[[], None]) -> None:
    """Say what is to be called before the last line is printed: what takes down a live view, or nothing."""
    _shown[:] = take_down


def stopped() -> str:
    """What a program says that was stopped."""
    return f"stopped; {_going_on}" if _going_on else "stopped"


def answer() -> None:
    """Keep the listening thread from ending the program, which has heard, and ends by itself when its work is saved."""
    _answered.set()


def was_interrupted() -> bool:
    """Whether there was a Ctrl-C since the program listens."""
    return _heard.is_set()


def listen(status: int = INTERRUPTED, says: bool = True) -> None:
    """End the process if it does not answer a Ctrl-C in time. To be called in its main thread, once.

    Args:
        status: what it ends with then.
        says: whether it says that it was stopped.
    """
    ears, mouth = socket.socketpair()
    mouth.setblocking(False)
    signal.set_wakeup_fd(mouth.fileno(), warn_on_full_buffer=False)

    def wait() -> None:
        while signal.SIGINT not in ears.recv(1):
            pass
        _heard.set()
        if not _answered.wait(PATIENCE):
            leave(status, stopped() if says else "")
        mouth.fileno()  # whose life is that of this thread

    def hear(number: int, frame: FrameType | None) -> NoReturn:
        _heard.set()
        if _is_loading(frame):
            leave(status, stopped() if says else "")  # what is half loaded crashes where an exception passes through it
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, hear)
    threading.Thread(target=wait, name="Ctrl-C", daemon=True).start()


def _is_loading(frame: FrameType | None) -> bool:
    """Whether a module is being imported."""
    while frame and not frame.f_code.co_filename.startswith("<frozen importlib"):
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
        pass  # whoever read it is gone
    os._exit(status)
