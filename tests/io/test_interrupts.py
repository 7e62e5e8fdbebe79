"""Ctrl-C in real processes: they end soon, say that they were stopped, with status 130, and never crash."""

import signal
import subprocess
import sys

import pytest

SOON = 2.0 + 6.0
"""Seconds from Ctrl-C to the end of a program: what is promised, and what a busy machine may add."""
COMMAND = "import sys; from apollonius.__main__ import main; print('begun', flush=True); sys.exit(main())"
"""A program hears from its first tenth of a second on, which a busy machine makes longer: so it has begun then."""


def interrupted(code, *arguments, after=0.0, folder=None):
    """Status, output and errors of a program that gets a Ctrl-C some seconds after its first line of output."""
    with subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder,
    ) as process:  # fmt: skip
        try:
            assert process.stdout.readline() == "begun\n"
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(after)
            process.send_signal(signal.SIGINT)
            output, errors = process.communicate(timeout=SOON)
        finally:
            process.kill()
    return process.returncode, output, errors


PLAYS = ["evaluate", "random", "random", "--games", str(10**6)]


@pytest.mark.parametrize(
    "after", [0.5, pytest.param(6.0, marks=pytest.mark.slow)], ids=["while it loads or compiles", "while it plays"]
)
def test_a_long_match_stops(after):
    status, output, errors = interrupted(COMMAND, *PLAYS, after=after)
    assert (status, output) == (130, "")
    assert errors.splitlines()[-1] == "stopped"
    assert "Traceback" not in errors


@pytest.mark.parametrize("loading", ["apollonius.io.interrupts", "apollonius.cli.train"])
def test_ctrl_c_while_the_command_itself_is_loaded_is_no_traceback(loading):
    early = f"""
import os, runpy, signal, sys

class Interrupts:
    def find_spec(self, name, *_):
        if name == {loading!r}:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupts())
runpy.run_module("apollonius", run_name="__main__", alter_sys=True)
"""
    done = subprocess.run([sys.executable, "-c", early, *PLAYS[:3]], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "stopped\n")


def test_a_program_that_cannot_hear_is_ended_and_says_how_to_go_on():
    """A single call into native code, as a compilation is one, here of some minutes."""
    deaf = """
import hashlib
from apollonius.io.interrupts import go_on, listen
listen()
go_on("go on with: patience")
print("begun", flush=True)
hashlib.pbkdf2_hmac("sha256", b"", b"", 10**9)
"""
    assert interrupted(deaf, after=0.2) == (130, "", "stopped; go on with: patience\n")


def test_a_program_that_has_heard_may_take_its_time_to_save():
    saving = """
import signal, sys, time
from apollonius.io import interrupts
heard = []
interrupts.listen()
signal.signal(signal.SIGINT, lambda *_: heard.append(True))
print("begun", flush=True)
while not heard:
    time.sleep(0.01)
interrupts._answered.set()
time.sleep(interrupts.PATIENCE + 0.5)
print("saved")
sys.exit(5)
"""
    assert interrupted(saving, after=0.2) == (5, "saved\n", "")
