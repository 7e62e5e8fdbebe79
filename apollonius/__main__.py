"""`python -m apollonius` is the command, and so is `apollonius`."""

import os
import sys
from signal import SIGINT, signal


def main() -> int:
    """Run the command of this process; return its exit status. A Ctrl-C ends it, whatever it is
    doing.
    """
    signal(SIGINT, _leave)  # what follows takes a moment to import
    os.environ.setdefault(
        "TF_CPP_MIN_LOG_LEVEL", "3"
    )  # or XLA raises alarm at a compilation of some minutes
    from apollonius.io.interrupts import interrupt_status, leave, listen, stop_message

    listen()
    try:
        from apollonius.cli.main import main as run

        ended = run()
    except BaseException:
        # A module that is being loaded makes errors of its own of a Ctrl-C.
        number = interrupt_status()
        if number:
            leave(number, stop_message())
        raise
    if interrupt_status():
        leave(ended)
    return ended


def _leave(number: int, frame: object) -> None:
    os.write(2, b"stopped\n")
    os._exit(128 + number)


if __name__ == "__main__":  # the processes that train side by side import this file too
    sys.exit(main())
