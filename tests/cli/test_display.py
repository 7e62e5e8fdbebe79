"""What a person sees while a command works: within a second, on standard error, and one line where it is refused."""

import os
import pty
import subprocess
import sys
import time

import pytest

from apollonius.cli import display as module
from apollonius.cli.display import Display


def test_in_a_pipe_lines_come_with_the_first_report(monkeypatch, capsys):
    monkeypatch.setattr(module, "_LINE_SECONDS", 0.05)
    with Display("evaluate") as display:
        display.begin("playing 8 games", compiles=True)
        time.sleep(0.2)
        assert capsys.readouterr().err == "", "a refusal would be the only line"
        display.tell("P against E: 50.0%")
        display.report(2, 8)
        display.note({"loss": "0.5"})
        time.sleep(0.2)
        first, *_, last = capsys.readouterr().err.splitlines()
    assert first == "P against E: 50.0%"
    assert last == "apollonius evaluate: playing 8 games, 25.0%, loss 0.5"


@pytest.mark.parametrize(
    ("seconds", "shares", "state"),
    [(20, [], "0.0%"), (1, [0.01, 0.02, 0.03], "3.0%, 0:01:38 left"), (60, [0.1, 0.2, 0.3], "30.0%, 0:07:00 left")],
    ids=["nothing known", "fast", "slow"],
)
def test_the_time_left_is_that_of_what_is_reported_and_not_of_its_compilation(seconds, shares, state):
    now = [100.0]
    display = Display("train", lambda: now[0])
    for what in ("another piece", "playing"):
        display.begin(what, compiles=True)
        assert (display.state(), display.tasks[0].total) == (f"{what} (compiling), 0.0%", None)
        now[0] += 30
        for share in shares:
            now[0] += seconds
            display.report(share, 1)
        assert display.state() == f"{what}{' (compiling)' * (not shares)}, {state}"


def test_in_a_terminal_the_bar_is_gone_at_the_end_and_the_results_stay():
    """In a process of its own: a live bar within a second, its place given back, the results below."""
    leader, follower = pty.openpty()
    script = (
        "import time\nfrom apollonius.cli.display import Display\n"
        "with Display('evaluate') as display:\n"
        "    display.begin('playing 8 games')\n    display.report(3, 8)\n    display.note({'loss': 'pursuer 0.5'})\n"
        "    time.sleep(0.6)\n    print('a result, below the bar')\n"
        "print('the last result')\n"
    )
    process = subprocess.Popen([sys.executable, "-c", script], stdout=follower, stderr=follower, close_fds=True)
    os.close(follower)
    written = b""
    with os.fdopen(leader, "rb", buffering=0) as terminal:
        try:
            while part := terminal.read(65536):
                written += part
        except OSError:  # the other end is closed
            pass
    assert process.wait() == 0
    text = written.decode()
    for shown in ("playing 8 games", " 38%", "loss", "pursuer 0.5"):
        assert shown in text
    assert text.index("a result, below the bar") < text.rindex("the last result")
    assert "playing" not in text[text.rindex("\x1b[2K") :]
