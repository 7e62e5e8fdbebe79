"""What a person sees while a command works: within a second, on standard error, and one line where it is refused."""

import io
import json
import os
import pty
import subprocess
import sys
import time

import pytest
from rich.console import Console

from apollonius import display as module
from apollonius.cli import main
from apollonius.display import Display
from apollonius.errors import InvalidInput


@pytest.fixture
def quick(monkeypatch):
    """Seconds are hundredths of seconds."""
    monkeypatch.setattr(module, "_FIRST_SECONDS", 0.007)
    monkeypatch.setattr(module, "_NEXT_SECONDS", 0.1)
    monkeypatch.setattr(module, "_LOOKS_A_SECOND", 500)


def wait_for(capsys, text, seconds=5.0):
    """What was written to standard error until the text came."""
    written, end = "", time.monotonic() + seconds
    while text not in written and time.monotonic() < end:
        time.sleep(0.005)
        written += capsys.readouterr().err
    assert text in written
    return written


def test_a_quick_command_says_nothing(capsys):
    with Display("evaluate") as display:
        display.begin("playing")
        display.report(1, 1)
    assert capsys.readouterr().err == ""


def test_it_says_what_how_far_and_how_long(quick, capsys):
    with Display("evaluate") as display:
        wait_for(capsys, "apollonius evaluate: loading, 0:00:00 so far ... ")
        display.begin("playing 8 games", compiles=True)
        wait_for(capsys, "playing 8 games (compiling), 0:00:00 so far ... ")
        display.report(0, 8)
        time.sleep(1.6)
        display.report(2, 8)
        display.note({"loss": "0.5"})
        written = wait_for(capsys, "loss 0.5\n")
    last = written.splitlines()[-1]
    assert last.startswith("apollonius evaluate: playing 8 games, 25.0%, 0:00:0")
    assert last.endswith(" left, loss 0.5")
    assert capsys.readouterr().err == ""


def test_a_refusal_stays_one_line(quick, capsys):
    """However long it took to find out."""
    with Display("evaluate") as display:
        written = wait_for(capsys, "loading")
        display.begin("playing")
        written += wait_for(capsys, "playing")
        display.__exit__(InvalidInput, InvalidInput("no."), None)
        assert "\n" not in written + capsys.readouterr().err


def test_everything_else_ends_the_line(quick, capsys):
    with Display("evaluate") as display:
        wait_for(capsys, "loading")
        display.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
        assert capsys.readouterr().err.endswith("\n")


def test_lines_that_stay_stand_on_their_own(quick, capsys):
    with Display("tournament") as display:
        written = wait_for(capsys, "loading")
        display.tell("P against E: 50.0%")
        written += capsys.readouterr().err
    assert "P against E: 50.0%" in written.splitlines()


def test_it_asks_who_does_not_report(quick, capsys):
    with Display("reproduce") as display:
        display.begin("training the agents", poll=lambda: (30, 40))
        wait_for(capsys, "training the agents, 75.0%")


def test_the_live_view_has_all_of_it():
    with Display("train") as display:
        display.plan({"fixed-target": 3.0, "judging": 1.0})
        display.begin("fixed-target", compiles=True)
        assert "fixed-target (compiling)" in drawn(display)
        display.report(1, 2)
        display.note({"loss": "pursuer 0.5"})
        screen = drawn(display)
    assert "fixed-target " in screen
    assert "(compiling)" not in screen
    assert " 38%" in screen
    assert "loss" in screen
    assert "pursuer 0.5" in screen


def drawn(display):
    console = Console(file=io.StringIO(), width=100, force_terminal=True, color_system=None)
    console.print(display._screen())
    return console.file.getvalue()


def test_in_a_terminal_the_bar_is_gone_at_the_end_and_the_results_stay():
    """In a process of its own: a live bar within a second, its place given back, the results below."""
    leader, follower = pty.openpty()
    script = (
        "import time\nfrom apollonius.display import Display\n"
        "with Display('evaluate') as display:\n"
        "    display.begin('playing 8 games')\n    time.sleep(0.6)\n    print('a result, below the bar')\n"
        "print('the last result')\n"
    )
    process = subprocess.Popen([sys.executable, "-c", script], stdout=follower, stderr=follower, close_fds=True)
    os.close(follower)
    written = b""
    while True:
        try:
            part = os.read(leader, 65536)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        written += part
    assert process.wait() == 0
    text = written.decode()
    assert "playing 8 games" in text
    assert text.index("a result, below the bar") < text.rindex("the last result")
    after_the_bar = text[text.rindex("\x1b[2K") :]
    assert "the last result" in after_the_bar
    assert "playing" not in after_the_bar


def test_standard_output_has_nothing_but_json(quick, capsys):
    assert main(["evaluate", "random", "still", "--games", "20", "--json"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["games"] == 20
    assert "apollonius evaluate: " in printed.err
