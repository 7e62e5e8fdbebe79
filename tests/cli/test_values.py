"""Every argument of every command with values that are huge, odd or empty: taken where they make sense, or refused in
one line with status 2 before anything is done."""

import argparse
import os
import subprocess
import sys
from pathlib import Path

import pytest

from apollonius.cli import values
from apollonius.cli.main import build_parser, main
from apollonius.io import limits
from apollonius.io.errors import InvalidInput, shown
from apollonius.io.limits import GAMES, Counted

HUGE = [str(2**31), str(2**63), str(10**30)]
ODD = ["0", "-1", *HUGE, "nan", "inf", "", "folder", "nowhere/deeper", "9" * 5_000]
"""What every argument is given."""
NONE: set[str] = set()
EVERYTHING = set(ODD[:-1]) - {""}
KINDS: dict[str, set[str]] = {
    "count": NONE,
    "count from 0": {"0"},
    "seed": {"0", str(2**31)},
    "real": {"0", "-1"},
    "values": NONE,
    "choice": NONE,
    "nodes": NONE,
    "file to write": NONE,
    "folder to write": EVERYTHING,
    "file to read": NONE,
    "folder to read": {"folder"},
    "name": EVERYTHING | {"9" * 5_000},
    "agent": {"folder", "nowhere/deeper"},
    "game": {"nowhere/deeper"},
}
"""The odd values that make sense for an argument of each kind; a name is looked up when the command runs."""
COUNTS = "games hold responses env_steps seeds port most"
REALS = "gap size opponent opponent_speed opponent_heading speed heading target"
CHOICES = "action what role attackers on to starts stage algorithm opponents preset profile budget side kind part"
ARGUMENTS = {
    **dict.fromkeys(COUNTS.split(), "count"),
    **dict.fromkeys(["record", "discs"], "count from 0"),
    "seed": "seed",
    **dict.fromkeys(REALS.split(), "real"),
    **dict.fromkeys(CHOICES.split(), "choice"),
    "vary": "values",
    "grid": "nodes",
    **dict.fromkeys(["out", "plot"], "file to write"),
    **dict.fromkeys(["train out", "exploit out", "reproduce out", "replays", "keep", "site"], "folder to write"),
    **dict.fromkeys(["tables", "config", "drive"], "file to read"),
    "folder": "folder to read",
    **dict.fromkeys(["pursuer", "evader", "pursuers", "evaders", "agent", "first", "against"], "agent"),
    "observation": "name",
    "game": "game",
}
"""The kind of each argument, by its name, or by command and name where commands differ."""
ENOUGH = {
    "train": {},
    "resume": {"folder": ["folder"]},
    "evaluate": {"pursuer": ["random"], "evader": ["still"]},
    "simulate": {"pursuer": ["random"], "evader": ["still"]},
    "tournament": {},
    "exploit": {"side": ["pursuer"], "agent": ["random"]},
    "solve": {"what": ["safety"]},
    "regret": {"agent": ["random"]},
    "show": {"pursuer": ["random"], "evader": ["still"]},
    "slice": {"agent": ["P_stage1"], "--opponent": ["5", "5"]},
    "report": {"folder": ["folder"]},
    "play": {},
    "pursuers": {"game": ["paper"]},
    "arena list": {},
    "arena check": {"game": ["paper"]},
    "arena suite": {},
    "arena random": {"--out": ["new.toml"]},
    "export": {"agent": ["P_pool"], "--to": ["c"], "--out": ["a.c"]},
    "reproduce": {},
}
"""Arguments that each command cannot do without."""


def parsers(parser, path=()):
    """Every command's words and its parser."""
    nested = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not nested:
        yield " ".join(path), parser
    for action in nested:
        for name, inner in action.choices.items():
            yield from parsers(inner, (*path, name))


def arguments():
    """Every argument that takes a value: the command, what the argument is called, how many values, and its kind."""
    for command, parser in parsers(build_parser()):
        for action in parser._actions:
            if action.nargs != 0:
                name = action.option_strings[-1] if action.option_strings else action.dest
                kind = ARGUMENTS.get(f"{command} {action.dest}") or ARGUMENTS.get(action.dest, "of no known kind")
                yield command, name, action.nargs if isinstance(action.nargs, int) else 1, kind


def line(command, name, value, times):
    """A command line with this value of one argument."""
    asked = ENOUGH[command] | {name: [value] * times}
    options = [word for key, words in asked.items() if key.startswith("-") for word in (key, *words)]
    return [*command.split(), *[word for key, words in asked.items() if key[0] != "-" for word in words], *options]


def refusal(capsys, act):
    """The line with which something is refused; None where it is not."""
    try:
        status = act()
    except SystemExit as leaving:
        status = leaving.code
    printed = capsys.readouterr()
    if status != 2:
        return None
    assert printed.out == ""
    assert printed.err.count("\n") == 1, printed.err
    assert len(printed.err) < 1_500
    return printed.err


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """In a folder with nothing but an empty folder."""
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("command", "name", "times", "kind"), list(arguments()), ids=lambda value: str(value).strip("-")
)
def test_every_odd_value_makes_sense_or_is_refused_as_it_is_read(capsys, command, name, times, kind):
    assert kind in KINDS, "say in ARGUMENTS what kind of argument this is"
    parser = build_parser()
    for value in ODD:
        told = refusal(capsys, lambda value=value: parser.parse_args(line(command, name, value, times)))
        assert (told is None) == (value in KINDS[kind]), (value[:40], told)
        if told and kind not in ("choice", "agent", "game"):
            assert "is not possible: it must be" in told
            assert shown(value) in told
    assert [str(path) for path in Path().rglob("*")] == ["folder"]


NAMES = [(command, name) for command, name, _, kind in arguments() if kind in ("name", "agent", "game")]


@pytest.mark.parametrize(("command", "name"), NAMES, ids=lambda value: value.strip("-"))
def test_no_odd_value_is_the_name_of_anything(capsys, command, name):
    for value in ["nan", "folder", "9" * 5_000, "missing.safetensors"]:
        told = refusal(capsys, lambda value=value: main(line(command, name, value, 1)))
        assert told is not None, value
    assert [str(path) for path in Path().rglob("*")] == ["folder"]


@pytest.mark.parametrize(
    "words",
    [
        ["evaluate", "random", "still", "--games", "5", "--record", "6"],
        ["resume", "folder"],
        ["report", "folder"],
        ["arena", "random", "--size", "0", "-1", "--out", "a.toml"],
        ["arena", "random", "--gap", "-1", "--out", "a.toml"],
        ["slice", "P_stage1", "--opponent", "5", "5", "--opponent-speed", "-1"],
        ["slice", "P_stage1", "--opponent", "0", "-1"],
        ["solve", "reach", "--target", "0", "-1"],
        ["solve", "safety", "--hold", "20000"],
        ["solve", "game", "--hold", "20000"],
        ["evaluate", "random", "still", "--vary", "pursuer.radius=0:6:2"],
        ["evaluate", "random", "still", "--vary", "dt=0.1:0.2:2", "--vary", "dt=0.1:0.2:2"],
        ["evaluate", "random", "still", "--vary", "dt=0.1:0.2:2", "--record", "1"],
        ["evaluate", "random", "still", "--out", "a.png"],
        ["regret", "still", "--games", "2147483647"],
    ],
    ids=" ".join,
)
def test_what_a_command_cannot_do_with_a_value_it_says_before_it_works(capsys, words):
    told = refusal(capsys, lambda: main(words))
    assert told is not None
    assert any(words in told for words in ("must be", "needs", "there is no", "no place to start", "did you mean"))
    assert [str(path) for path in Path().rglob("*")] == ["folder"]


def test_counts_are_bounded_by_memory(capsys, monkeypatch):
    assert 10**6 < GAMES.limit <= 2**31 - 1
    monkeypatch.setattr(limits, "available_memory", lambda: 10**6)
    assert GAMES.limit == 4_000
    assert values.count(GAMES)("4000") == 4_000
    with pytest.raises(argparse.ArgumentTypeError, match=r"4001 .* at least 1, at most 4,000, for which 0.0 GiB"):
        values.count(GAMES)("4001")
    told = refusal(capsys, lambda: main(["evaluate", "random", "still", "--games", "4001"]))
    assert told is not None
    assert "apollonius evaluate: --games = 4001 is not possible: it must be a whole number, at least 1" in told
    assert Counted(0, most=5, least=0).bound() == "a whole number, at least 0, at most 5"


def test_the_memory_of_a_container_counts(tmp_path, monkeypatch):
    whole = limits.available_memory()
    for text, found in (("1000000\n", 10**6), ("max\n", whole), (f"{2**62}\n", whole)):
        (tmp_path / "memory.max").write_text(text)
        monkeypatch.setattr(limits, "_GROUP_LIMITS", (str(tmp_path / "memory.max"), str(tmp_path / "none")))
        assert limits.available_memory() == found


def test_a_place_that_cannot_be_written_to_is_refused_at_once(here):
    Path("file").write_text("")
    for parse, text in (
        (values.new_folder, "file"),
        (values.new_folder, "file/deeper"),
        (values.new_file(".png"), "file/a.png"),
        (values.new_file(".png"), "/proc/a.png"),
        (values.new_file(".png"), f"{'long' * 100}.png/a.png"),
        (values.new_file(".png"), "\0.png"),
    ):
        with pytest.raises(argparse.ArgumentTypeError, match="it must be"):
            parse(text)
    Path("folder.png").mkdir()
    with pytest.raises(argparse.ArgumentTypeError, match="something else has that name"):
        values.new_file(".png")("folder.png")
    assert values.new_file(".png", ".gif")("new/deeper/a.gif") == Path("new/deeper/a.gif")
    with pytest.raises(InvalidInput, match=r"--out = file/deeper .* can be written to"):
        values.require_writable("--out", Path("file/deeper"))
    assert sorted(os.listdir(here)) == ["file", "folder", "folder.png"]


def test_a_written_grid_is_read():
    assert values.nodes("101x51x9x47") == (101, 51, 9, 47)
    for text in ("10x10x9x", "10x-3x9x47", "10.5x10x9x47", "1x2x3x4x5", "9" * 5_000 + "x2x2x3", "٣x3x3x3"):
        with pytest.raises(argparse.ArgumentTypeError, match="101x101x9x47"):
            values.nodes(text)


def test_the_choices_are_those_of_the_code_that_is_not_imported_for_them():
    from apollonius.agents.built_in import PLAYERS
    from apollonius.agents.names import BUILT_IN
    from apollonius.cli.exploit import ATTACKERS
    from apollonius.cli.options import LENGTHS
    from apollonius.cli.show import MOVING
    from apollonius.cli.train import BY_TABLE, PROFILES
    from apollonius.exploit.attackers import KINDS
    from apollonius.game import names
    from apollonius.game import presets as games
    from apollonius.learn import learner_config
    from apollonius.learn.config import DISTILLATIONS, PRESETS
    from apollonius.show import animation

    assert set(LENGTHS) == set(PRESETS)
    assert set(BY_TABLE) == set(DISTILLATIONS)
    assert list(ATTACKERS) == list(KINDS)
    assert tuple(PLAYERS) == BUILT_IN
    assert tuple(games.PRESETS) == names.PRESETS
    assert set(PROFILES) == set(learner_config.PROFILES)
    assert MOVING == animation.MOVING


def test_a_value_is_shown_on_one_short_line():
    assert shown("two\nlines\x1b[31m") == "two lines\\x1b[31m"
    assert len(shown("x" * 10_000)) < 250
    assert shown(16**5_000) == "a number of thousands of digits"
    assert "\n" not in str(InvalidInput("one\ntwo"))


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["evaluate", "random", "still", "--games", str(10**10)],
        ["solve", "safety", "--hold", str(10**11)],
        ["reproduce", "--seeds", str(10**9)],
        ["exploit", "pursuer", "P_stage1", "--games", "0"],
        ["arena", "random", "--size", "inf", "5", "--out", "a.toml"],
        ["train", "--out", ""],
        ["evaluate", "P_pol", "still"],
        ["evaluate", "P_pool", "still", "--game", "ofice"],
        ["report", "folder"],
    ],
    ids=" ".join,
)
def test_the_command_itself_refuses_without_importing_jax(words):
    script = (
        "import sys\nfrom apollonius.cli.main import main\ntry:\n main()\nfinally:\n assert 'jax' not in sys.modules"
    )
    said = subprocess.run(
        [sys.executable, "-c", script, *words], env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (said.returncode, said.stdout, said.stderr.count("\n")) == (2, "", 1)
    assert os.listdir() == ["folder"]
