"""Every argument of every command with values that are huge, odd or empty, and what is shown while a command works."""

import argparse
import os
import pty
import subprocess
import sys
import threading
import time
from pathlib import Path

import jax
import pytest

from apollonius.cli import display, values
from apollonius.cli.display import Display
from apollonius.cli.main import build_parser
from apollonius.cli.terminal import bar
from apollonius.io import compiling, limits
from apollonius.io.errors import InvalidInput, format_value
from apollonius.io.limits import GAMES, RECORDS, SEED, CountLimit
from tests.cli.test_cli import assert_refused

ODD = ["0", "-1", str(2**31), str(2**63), str(10**30), "nan", "inf", "", "folder", "nowhere/deeper", "9" * 5_000]
"""What every argument is given."""
EVERYTHING = set(ODD[:-1]) - {""}
SENSIBLE = {
    values.whole_number(GAMES): set(), values.whole_number(RECORDS): {"0"},
    values.whole_number(SEED): {"0", str(2**31)},
    values.real_number: {"0", "-1"}, values.swept_number: set(), values.nodes: set(), values.new_file(".png"): set(),
    values.new_folder: EVERYTHING, values.existing_file: set(), values.run_folder: set(),
    values.player_or_file: EVERYTHING | {"9" * 5_000},
}  # fmt: skip
"""The odd values that make sense to each type of argument."""


def arguments(parser):
    """All arguments of all commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from arguments(command)
        else:
            yield action


@pytest.fixture(autouse=True)
def folder(in_a_folder_of_its_own):
    Path("folder").mkdir()


def test_bar_has_a_length_proportional_to_its_share():
    assert [bar(share, 4) for share in (0.0, 0.001, 0.5, 0.53, 1.0)] == ["", "▏", "██", "██▏", "████"]


def test_every_argument_with_a_value_has_a_checked_type_or_choices():
    for action in arguments(build_parser()):
        if action.nargs != 0 and not action.choices:
            kind = getattr(action.type, "func", action.type)
            assert getattr(kind, "__module__", None) == values.__name__, action


@pytest.mark.parametrize("parse", SENSIBLE, ids=lambda parse: getattr(parse, "func", parse).__name__)
def test_every_odd_value_is_accepted_or_refused_by_its_parser(parse):
    for value in ODD:
        told = None
        try:
            parse(value)
        except argparse.ArgumentTypeError as refusal:
            told = str(refusal)
            assert "is not possible: it must be" in told or told.startswith("no such ")
            assert format_value(value) in told
        assert (told is None) == (value in SENSIBLE[parse]), (value[:40], told)
    assert [str(path) for path in Path().rglob("*")] == ["folder"]


def test_counts_are_bounded_by_memory(capsys, monkeypatch):
    assert 10**6 < GAMES.limit <= 2**31 - 1
    monkeypatch.setattr(limits, "available_memory", lambda: 10**6)
    assert GAMES.limit == 4_000
    assert values.whole_number(GAMES)("4000") == values.whole_number(GAMES)("4e3") == 4_000
    with pytest.raises(argparse.ArgumentTypeError, match=r"4001 .* at least 1, at most 4,000, for which 0.0 GiB"):
        values.whole_number(GAMES)("4001")
    said = "apollonius evaluate: --games = 4001 is not possible: it must be a whole number, at least 1"
    assert_refused(capsys, "evaluate", "random", "still", "--games", "4001", naming=[said])
    assert CountLimit(0, most=5, least=0).bound() == "a whole number, at least 0, at most 5"


def test_available_memory_respects_the_limit_of_a_container(tmp_path, monkeypatch):
    whole = limits.available_memory()
    for text, found in (("1000000\n", 10**6), ("max\n", whole), (f"{2**62}\n", whole)):
        (tmp_path / "memory.max").write_text(text)
        monkeypatch.setattr(limits, "_GROUP_LIMITS", (str(tmp_path / "memory.max"), str(tmp_path / "none")))
        assert limits.available_memory() == found
    monkeypatch.setattr(limits, "_GROUP_LIMITS", ())
    monkeypatch.delattr("os.sysconf")
    assert limits.available_memory() == 8 * 1024**3, "where nobody says"


def test_unwritable_output_paths_are_refused_at_once():
    Path("file").write_text("", encoding="utf-8")
    png = values.new_file(".png")
    inside = (values.new_folder, "file"), (values.new_folder, "file/deeper"), (png, "file/a.png")
    for parse, text in (*inside, (png, "/proc/a.png"), (png, f"{'long' * 100}.png/a.png"), (png, "\0.png")):
        with pytest.raises(argparse.ArgumentTypeError, match="it must be"):
            parse(text)
    Path("folder.png").mkdir()
    with pytest.raises(argparse.ArgumentTypeError, match="something else has that name"):
        png("folder.png")
    assert values.new_file(".png", ".gif")("new/deeper/a.gif") == Path("new/deeper/a.gif")
    with pytest.raises(InvalidInput, match=r"--out = file/deeper .* can be written to"):
        values.require_writable("--out", Path("file/deeper"))
    assert sorted(os.listdir()) == ["file", "folder", "folder.png"]


def test_slurm_is_accepted_only_with_sbatch_on_the_path(monkeypatch):
    monkeypatch.setattr(values, "missing_extra", lambda *_: "")
    monkeypatch.setattr("shutil.which", str)
    assert values.installed_extra("slurm") == "slurm"
    monkeypatch.setattr("shutil.which", lambda name: None)
    with pytest.raises(argparse.ArgumentTypeError, match="sbatch is not on the PATH"):
        values.installed_extra("slurm")


def test_nodes_parses_a_grid_and_refuses_others():
    assert values.nodes("101x51x9x47") == (101, 51, 9, 47)
    for text in ("10x10x9x", "10x-3x9x47", "10.5x10x9x47", "1x2x3x4x5", "9" * 5_000 + "x2x2x3", "٣x3x3x3"):
        with pytest.raises(argparse.ArgumentTypeError, match="101x101x9x47"):
            values.nodes(text)


def test_choices_match_the_modules_they_stand_for():
    from apollonius.agents import built_in, names
    from apollonius.cli import exploit, judge, options, show, train
    from apollonius.evaluate import panels
    from apollonius.exploit import attackers
    from apollonius.game import names as games
    from apollonius.game import presets
    from apollonius.learn import config, dqn
    from apollonius.show import animation

    assert set(judge.TRACKS) == set(panels.PANELS)
    assert set(options.LENGTHS) == set(config.PRESETS)
    assert [*exploit.ATTACKERS] == ["table", "zoo", attackers.PLANNER, attackers.LEARNED]
    assert list(built_in.PLAYERS) == list(names.BUILT_IN)
    assert tuple(presets.PRESETS) == games.PRESETS
    assert set(train.PROFILES) == set(dqn.PROFILES)
    assert show.MOVING == animation.MOVING


def test_values_in_messages_are_one_short_printable_line():
    assert format_value("two\nlines\x1b[31m") == "two lines\\x1b[31m"
    assert len(format_value("x" * 10_000)) < 250
    assert format_value(16**5_000) == "a number of thousands of digits"
    assert "\n" not in str(InvalidInput("one\ntwo"))


def test_progress_in_a_pipe_is_printed_soon_and_then_ever_less_often(monkeypatch, capsys):
    monkeypatch.setattr(display, "_LOOK_SECONDS", 0.002)
    monkeypatch.setattr(display, "_FIRST_LINE_SECONDS", 1.0)
    now = [0.0]
    with Display("evaluate", lambda: now[0]) as live:

        def lines_until(second):
            while now[0] < second:
                now[0] += 1
                time.sleep(0.008)
            return capsys.readouterr().err.splitlines()

        assert lines_until(100) == [], "a refusal would be the only line"
        live.begin_task("playing 8 games")
        assert lines_until(103) == ["apollonius evaluate: playing 8 games, 0:00:01"]
        live.print_line("P against E:\n50.0%\x1b[2J")
        live.report(2, 8)
        live.note({"loss": "0.5"})
        told, *lines = lines_until(700)
        assert told == "P against E: 50.0%\\x1b[2J"
        assert lines[0] == "apollonius evaluate: playing 8 games, 25.0%, 0:00:11, loss 0.5"
        assert 14 <= len(lines) <= 17


def test_display_polls_the_share_of_a_task_that_reports_none(monkeypatch, capsys):
    monkeypatch.setattr(display, "_LOOK_SECONDS", 0.01)
    monkeypatch.setattr(display, "_FIRST_LINE_SECONDS", 1.0)
    now = [0.0]
    with Display("reproduce", lambda: now[0]) as live:
        live.begin_task("training", lambda: 0.25)
        now[0] = 2.0
        time.sleep(0.2)
    assert capsys.readouterr().err == "apollonius reproduce: training, 25.0%, 0:00:02\n"


@pytest.mark.parametrize(
    ("seconds", "shares", "state"),
    [
        (20, [0.3], "30.0%, 0:00:50"),
        (1, [0.01, 0.02], "2.0%, 0:00:32"),
        (1, [0.01, 0.02, 0.03], "3.0%, 0:00:33, 0:01:37 left"),
        (60, [0.1, 0.2, 0.3], "30.0%, 0:03:30, 0:07:00 left"),
        (1, [0.5, 0.6, 0.7, 0.1], "10.0%, 0:00:34"),
    ],
    ids=["one", "one unit", "fast", "slow", "begun again"],
)
def test_time_left_excludes_compilation(seconds, shares, state):
    now = [100.0]
    live = Display("train", lambda: now[0])
    for what in ("another piece", "playing"):
        live.begin_task(what)
        assert (live.state(), live.tasks[0].total) == (f"{what}, 0:00:00", None)
        now[0] += 30
        for share in shares:
            now[0] += seconds
            live.report(share, 1)
        assert live.state() == f"{what}, {state}"


def test_time_left_counts_down_and_is_hidden_without_new_reports():
    now = [0.0]
    live = Display("arena", lambda: now[0])
    live.begin_task("playing")
    for done in (1, 2, 3, 4):
        now[0] += 10
        live.report(done, 10)
    assert live.seconds_left() == 60
    now[0] += 15
    assert live.seconds_left() == 45
    now[0] += 6
    assert live.seconds_left() is None


def test_display_shows_a_compilation_with_its_duration():
    compiling.watch_compilations()
    live, lowered = Display("evaluate", lambda: 0.0), jax.jit(lambda x: x * 2.5).lower(1.0)
    compiling._begun[threading.get_ident()] -= 72
    assert live.state() == "loading, 0:00:00, compiling (once) for 0:01:12"
    lowered.compile()
    assert live.state() == "loading, 0:00:00"


def test_terminal_bar_is_erased_at_the_end_and_results_remain():
    """In a process of its own: a live bar within a second, its place given back, the results below."""
    leader, follower = pty.openpty()
    script = (
        "import time\nfrom apollonius.cli.display import Display\n"
        "with Display('evaluate') as display:\n"
        "    display.begin_task('playing 8 games')\n    display.report(3, 8)\n"
        "    display.note({'loss': 'pursuer 0.5'})\n"
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
    assert all(part in text for part in ("playing 8 games", "37.5%", "loss", "pursuer 0.5"))
    assert text.index("a result, below the bar") < text.rindex("the last result")
    assert "playing" not in text[text.rindex("\x1b[2K") :]
