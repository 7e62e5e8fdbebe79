"""What a person sees while a command works: within a second, on standard error, and one line where it is refused."""

import io
import os
import pty
import subprocess
import sys
import time

import pytest
from rich.console import Console

from apollonius.cli import display as module
from apollonius.cli.display import Display


def wait_for(capsys, text, seconds=5.0):
    """Return the text on standard error as soon as it contains another one."""
    written, end = "", time.monotonic() + seconds
    while text not in written and time.monotonic() < end:
        time.sleep(0.005)
        written += capsys.readouterr().err
    assert text in written
    return written


def test_in_a_pipe_lines_come_with_the_first_report(monkeypatch, capsys):
    monkeypatch.setattr(module, "_LINE_SECONDS", 0.05)
    with Display("evaluate") as display:
        display.begin("playing 8 games", compiles=True)
        time.sleep(0.2)
        assert capsys.readouterr().err == "", "a refusal would be the only line"
        display.tell("P against E: 50.0%")
        display.report(0, 8)
        time.sleep(1.6)
        display.report(2, 8)
        display.note({"loss": "0.5"})
        first, *_, last = wait_for(capsys, "loss 0.5\n").splitlines()
    assert first == "P against E: 50.0%"
    assert last.startswith("apollonius evaluate: playing 8 games, 25.0%, 0:00:0")
    assert last.endswith(" left, loss 0.5")


class Clock:
    """A time that passes when it is told to."""

    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def timed():
    """A display, and the clock that it goes by."""
    clock = Clock()
    return Display("train", clock), clock


def go(timed, seconds, shares):
    """Report so many shares, each after so many seconds; return how the display stands then."""
    display, clock = timed
    for share in shares:
        clock.now += seconds
        display.report(share, 1)
    return display.state().split(", ")[1:]


@pytest.mark.parametrize(
    ("before", "seconds", "shares", "stands"),
    [
        ([], 20, [], ["0:00:20 so far"]),
        ([0.0], 0.5, [0.01, 0.02], ["2.0%", "0:00:31 so far"]),
        ([0.0], 1, [0.01, 0.02, 0.03], ["3.0%", "0:01:37 left"]),
        ([0.5], 1, [0.51, 0.52, 0.53], ["53.0%", "0:00:47 left"]),
        ([0.0], 60, [0.1, 0.2], ["20.0%", "0:08:00 left"]),
        ([0.0], 1, [0.5, 1.0], ["100.0%", "0:00:32 so far"]),
    ],
    ids=["nothing known", "too soon", "compiled first", "resumed", "slow", "over, and still at work"],
)
def test_the_time_left_is_that_of_what_is_reported(timed, before, seconds, shares, stands):
    timed[0].begin("playing", compiles=True)
    if before:
        go(timed, 30, before)
    timed[1].now += seconds * (not shares)
    assert go(timed, seconds, shares) == stands


def test_the_time_left_goes_by_between_reports_but_never_to_nothing(timed):
    timed[0].begin("sweeping")
    go(timed, 10, [0.1, 0.2, 0.3])
    for seconds, clock in ((20, "0:00:50 left"), (49, "0:00:01 left"), (1, "0:01:40 so far")):
        timed[1].now += seconds
        assert timed[0].state() == f"sweeping, 30.0%, {clock}"


def test_it_is_one_estimate_over_all_pieces(timed):
    """Pieces of 100, 200 and 20 units at one unit a second: what is not known is how long later ones compile."""
    display, clock = timed
    display.plan({"stage 1": 100.0, "stage 2": 200.0, "judging": 20.0})
    end, known = clock.now + 3 * 10 + 320, 0
    for what, amount in (("stage 1", 100), ("stage 2", 200), ("judging", 20)):
        display.begin(what, compiles=True)
        assert display.state().startswith(f"{what} (compiling), ")
        clock.now += 10
        for done in range(amount + 1):
            clock.now += done > 0
            display.report(done, amount)
            if " left" in display.state():
                minutes, seconds = display.state().split(" left")[0].split(":")[-2:]
                assert end - clock.now - 20 <= 60 * int(minutes) + int(seconds) <= end - clock.now
                known += 1
    assert known > 300
    assert " 100.0%," in display.state()


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
    console.print(display.get_renderable())
    return console.file.getvalue()


def test_in_a_terminal_the_bar_is_gone_at_the_end_and_the_results_stay():
    """In a process of its own: a live bar within a second, its place given back, the results below."""
    leader, follower = pty.openpty()
    script = (
        "import time\nfrom apollonius.cli.display import Display\n"
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
