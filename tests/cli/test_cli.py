"""The command: what it prints, and that it refuses bad input in one line and leaves everything as it was."""

import errno
import importlib
import io
import json
import os
import platform
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest
import tomli_w

import apollonius
from apollonius.agents.classical import Still
from apollonius.arenas.file import load_game, to_dict
from apollonius.arenas.random_arena import random_arena
from apollonius.catalogue import player_names
from apollonius.cli.main import main
from apollonius.cli.terminal import match_table
from apollonius.evaluate.match import MatchResult
from apollonius.game.outcome import counts_by_name
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import EXTRAS, InvalidInput
from apollonius.play.replay import load_replay
from apollonius.solve.store import load_solution
from tests.acting import a_match
from tests.documents import REPOSITORY
from tests.learn.tiny import STOPPING


@pytest.fixture
def tiny():
    """A config file of a training that takes seconds, with the promotion that optax needs."""
    Path("tiny.toml").write_text(tomli_w.dumps(to_dict(replace(STOPPING, seed=5))), encoding="utf-8")
    with jax.numpy_dtype_promotion("standard"):
        yield "tiny.toml"


def run_main(*arguments):
    try:
        return main(list(arguments))
    except SystemExit as leaving:
        return leaving.code


def run_process(script, *arguments):
    """The command in a process of its own, as `script` starts it."""
    return subprocess.run(
        [sys.executable, "-c", script, *arguments],
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=False,
    )


def everything_here():
    return {str(path): path.is_file() and path.read_bytes() for path in Path().rglob("*")}


def assert_refused(capsys, *arguments, naming):
    """One line on standard error that names these things, status 2, and nothing written."""
    before = everything_here()
    status = run_main(*arguments)
    printed = capsys.readouterr()
    assert status == 2
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert printed.err.endswith("\n")
    assert len(printed.err) < 1_500
    for what in naming:
        assert what in printed.err
    assert everything_here() == before


def test_closed_pipe_ends_the_command_without_a_message(monkeypatch):
    monkeypatch.setenv("APOLLONIUS_CACHE", "off")  # so that nothing imports JAX
    result = run_process(
        "import os, sys\nr, w = os.pipe(); os.dup2(w, 1); os.close(w); os.close(r)\n"
        "from apollonius.cli import arena, main\n"
        "arena.run_list = lambda options: print('arena' * 10_000)\n"
        "sys.exit(main.main(['arena', 'list']))"
    )
    assert (result.returncode, result.stderr) == (1, "")


@pytest.mark.parametrize(
    ("encoding", "errors", "written"),
    [("latin-1", "surrogateescape", b"\xb1?\n"), ("ascii", "strict", b"??\n"), ("utf-8", "strict", "±█\n".encode())],
)
def test_characters_outside_the_encoding_of_a_stream_are_replaced(monkeypatch, encoding, errors, written):
    for name in ("stdout", "stderr"):
        monkeypatch.setattr(sys, name, io.TextIOWrapper(io.BytesIO(), encoding, errors))
    monkeypatch.setattr("apollonius.cli.arena.run_list", lambda options: print("±█") or 0)
    run_main("arena", "list")
    sys.stdout.flush()
    assert sys.stdout.buffer.getvalue() == written


def test_help_version_and_refusals_import_no_heavy_modules():
    result = run_process(
        "import sys\n"
        "from apollonius.cli.main import main\n"
        "for words in sys.argv[1:]:\n"
        "    try:\n        main(words.split())\n"
        "    except SystemExit as leaving:\n        print(leaving.code)\n"
        "heavy = ('jax', 'numpy', 'matplotlib', 'scipy', 'scipy.stats', 'equinox', 'optax', 'rich')\n"
        "print('imported:', [name for name in heavy if name in sys.modules])",
        "", "--version", "evaluate random still --games 10000000000", "evaluate P_curriculm still", "report folder",
        "evaluate a.safetensors still", "show game.json", "evaluate nowhere/P still", "show evader still",
    )  # fmt: skip
    assert (result.returncode, result.stderr.count("\n")) == (0, 7)
    assert "train " in result.stdout
    assert result.stdout.splitlines()[-10:] == ["apollonius 0.1.0", "0", *["2"] * 7, "imported: []"]


def test_evaluate_prints_one_json_object_and_records_lost_games(capsys):
    match = ["evaluate", "random", "random", "--games", "30", "--seed", "4"]
    assert run_main(*match, "--record", "3", "--json") == 0
    printed = capsys.readouterr()
    assert printed.out.count("\n") == 1
    result = json.loads(printed.out)
    assert sum(result["outcomes"].values()) == result["games"] == 30
    wins = sum(result["outcomes"][name] for name in ("captured", "evader_hit_obstacle", "evader_out_of_range"))
    assert result["pursuer_win_rate"] == wins / 30
    for side in ("pursuer", "evader"):
        low, high = result[f"{side}_win_interval"]
        assert 0 <= low <= result[f"{side}_win_rate"] <= high <= 1
    asked = [result[name] for name in ("pursuer", "evader", "game", "starts", "seed")]
    assert asked == ["random", "random", "paper", "rest", 4]
    assert printed.err.startswith("wrote replays (")
    replays = [load_replay(path) for path in Path("replays").iterdir()]
    assert len({replay.index for replay in replays}) == 3
    assert {replay.outcome for replay in replays} <= {Outcome.PURSUER_HIT_OBSTACLE, Outcome.PURSUER_OUT_OF_RANGE}
    assert all(replay.first_difference() is None for replay in replays)
    changed = json.loads(next(Path("replays").iterdir()).read_text())
    changed["states"][5][0] += 1e-3
    Path("changed.json").write_text(json.dumps(changed), encoding="utf-8")
    assert run_main("show", "changed.json", "--out", "new/game.png") == 0
    said, errors = capsys.readouterr()
    assert said.startswith("random against random: pursuer ")
    assert "differs from step 5 on" in errors
    assert f"wrote new/game.png ({Path('new/game.png').stat().st_size / 1000:.0f} kB)" in errors


@pytest.mark.parametrize(
    ("captured", "verdict", "rate"),
    [
        (90, "The pursuer wins more", "90.00% of games (95 % interval 82.56% to 94.48%), loses 10.00% by"),
        (10, "The evader wins more", "10.00% of games"),
        (50, "Nobody surely wins more", "50.00% of games (95 % interval 40.38% to 59.62%), loses 50.00% by"),
    ],
)
def test_match_table_begins_with_the_verdict_and_its_interval(captured, verdict, rate):
    asked = a_match(make_game("paper"), Still(), Still(), 100)
    counts = counts_by_name([0, captured, 0, 0, 100 - captured, 0, 0, 0, 0])
    told = match_table(asked, MatchResult(counts, 9.0, None))
    assert told.startswith(f"{verdict}.\n  pursuer (pursuer) wins {rate}")


def test_players_lists_the_same_players_as_text_and_as_json(capsys):
    assert run_main("players") == 0
    lines = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines() if line.startswith("  ")]
    assert len({about for _, about in lines}) > 20
    assert run_main("players", "--json") == 0
    listed = json.loads(capsys.readouterr().out)
    sides = {one["name"]: [Role[side.upper()] for side in one["sides"]] for one in listed["players"]}
    assert sorted(name for name, _ in lines) == sorted([*sides, *listed["forms"]])
    game = make_game("paper")
    for role in Role:
        assert set(player_names(role, game)) <= {name for name in sides if role in sides[name]}
        assert {name for name in sides if role not in sides[name]}.isdisjoint(player_names(role, game))


@pytest.mark.slow
def test_slice_draws_an_agent_that_reads_a_chart(capsys, monkeypatch):
    monkeypatch.setattr("apollonius.show.slices.CELLS", 20)
    assert run_main("slice", "pursuer", "--opponent", "5", "5", "--opponent-speed", "1.2", "--out", "new/s.png") == 0
    told = capsys.readouterr().err.splitlines()
    assert told[0].startswith("wrote new/s.png (")
    assert told[1] == "next: apollonius show pursuer random --out new/s.gif"
    assert Path("new/s.png").read_bytes().startswith(b"\x89PNG")


RESPONSE, DISTILLATION = (REPOSITORY / f"examples/recipes/{name}.toml" for name in ("response", "optimal_evader"))
REFUSED = {
    "play --no-browser": "unrecognized arguments: --no-browser; see apollonius play --help",
    "fly": "apollonius: unknown command 'fly'; see apollonius --help\n",
    "trian": "apollonius: unknown command 'trian'; did you mean 'train'?\n",
    "arena chek": "apollonius arena: unknown command 'chek'; did you mean 'check'?\n",
    "train --preset quik": "train: --preset: unknown choice 'quik'; did you mean 'quick'?\n",
    "simulate random still --drive robot.toml": "--drive: no such file: 'robot.toml'; see apollonius simulate --help\n",
    "evaluate random": "EVADER", "evaluate P_curriculm still": "did you mean 'P_curriculum'",
    "evaluate P_curriculum E_pool": "unknown agent 'E_pool'; apollonius players lists all",
    "evaluate nobody still": "'nobody'; apollonius players lists all", "show shielded:nobody still": "'nobody'",
    "evaluate P_curriculum still --game ofice": "did you mean 'office'",
    "evaluate P_curriculum still --game team-3v1/ofice": "did you mean 'office'",
    "train --game chess": "paper, four-small, one-large, zero-sum",
    'train --stage fixed-target --vary stages.fixed-target.evaders=["nobody"]': "'nobody'; apollonius players",
    'train --stage fixed-target --vary stages.fixed-target.evaders=["random","still"]': "random, still is not",
    f'train --config {RESPONSE} --vary stages.response.opponents=["nobody"]': "'nobody'; apollonius players",
    f"train --config {DISTILLATION} --vary stages.distillation.teacher=nobody": "'nobody'; apollonius players",
    f"train --config {RESPONSE} --stage self-play": "--stage = self-play is not possible: it must be one of",
    "train --stage self-play --vary evader=random": "unknown agent 'random'",
    "evaluate random still --games 5 --record 6": "--record = 6 is not possible: it must be from 0 to --games = 5",
    "evaluate random still --vary pursuer.radius=0:6:2": "with pursuer.radius = 6",
    "evaluate random still --vary dt=0.1:0.2:2 --vary dt=0.1:0.2:2": "one or two different ones",
    "evaluate random still --vary dt=0.1:0.2:2 --record 1": "left out with --vary",
    "evaluate random still --out a.png": "--vary", "evaluate random still --replays a": "left out without --record",
    "evaluate flanking:shielded:pursuer still --game team-2v1": "'flanking:' in this order, each once",
    "evaluate searching:searching:pursuer still": "in this order, each once",
    "train --stage fixed-target --opponents uniform": "--opponents = uniform is not possible: it must be left out",
    f"train --config {RESPONSE} --preset quick": "not allowed with argument",
    f"train --config {RESPONSE} --profile fast": "left out with ppo",
    "exploit evader still --attackers zoo --responses 2": "--responses = 2 is not possible: it must be left out",
    "exploit evader still --attackers planner --grid 5x5x3x4": "left out without the attacker table",
    "exploit evader still --attackers zoo planner --games 1 --game team-2v1": "it must be 1 v 1: the planner",
    "evaluate random still --vary dt": "FIELD=FROM:TO:COUNT", "evaluate random still --vary dt=0.1:x:2": "= x",
    "evaluate random still --vary dt=1:1.0:2": "different ends",
    "evaluate random still --vary dt=0:0.1:1": "at least 2", "evaluate random still --vary u2=1:2:2": "did you mean",
    "show random still --out game.avi": "one of .gif, .webp, .png, .json",
    "show random still --out game.png --speed 2": "only .gif, .webp move",
    "show random still --out game.gif --speed 0": "from 0.05 to 100", "show nowhere.json": "no such file: 'nowhere",
    "report .": "RUN: no such folder of a training run: '.'",
    "resume folder": "no such folder of training runs: 'folder'",
    "runs folder": "no such folder of training runs: 'folder'",
    "train --seeds 3-1": "seeds as 0-9", "train --seeds x": "--seeds = x",
    "train --seed 1 --seeds 0-1": "left out with --seeds", "train --vary algorithm.batch": "FIELD=VALUE,VALUE",
    "train --vary algorithm.batch=1:2": "algorithm.batch", "train --vary lr=1": "unknown key 'lr'; remove it",
    "train --seeds 0-999,1000": "at most 1,000",
    f"train --vary stages.fixed-target.evaders={'[' * 5_000}": "evaders",
    "train --seeds 0-999 --vary algorithm.batch=1:100:100 --vary algorithm.width=1:100:100 --vary dt=1:100:100":
    "trainings = 1000000000 is not possible: it must be a whole number, at least 1, at most 1,000",
    "train --vary seed=1 --seeds 0-1": "of different fields", 
    "train --on moon": "unknown choice 'moon'; choose one of processes, slurm, ray; see",
    "slice P_stage1": "--opponent", "slice nobody --opponent 5 5": "'nobody'", "slice random --opponent 5 5": "random",
    "slice P_stage1 --opponent 3 3": "opponent = (3.0, 3.0) is not possible",
    "slice P_stage1 --opponent 5 5 --speed 2 --out new/s.png": "speed = 2",
    "slice P_stage1 --opponent 5 5 --opponent-speed -1": "opponent's speed = -1",
    "slice P_stage1 --opponent 5 5 --speed nan": "a number within 1e+06 of 0",
    "arena random --size 0 -1 --out a.toml": "height = (0.0, -1.0)", "arena random --gap -1 --out a.toml": "gap = -1",
    "solve game --target 1 2": "left out otherwise", "solve reach": "--target = None",
    "solve reach --target 3 3": "target = (3.0, 3.0)", "solve reach --target 0 -1": "target = (0.0, -1.0)",
    "solve reach --target 6 2 --role evader": "--role = evader is not possible: it must be left out for reach",
    "solve safety --grid 10x10": "101x101x9x47",
    "solve safety --hold 0": "--hold = 0 is not possible: it must be a whole number, at least 1",
    "solve game --hold 20000": "hold = 20000", "solve safety --grid 9001x9001x99x99": "GiB",
    "regret E_scratch": "plays the evader", "regret P_stage1 --role robot": "--role",
    "regret still --games 2147483647": "--games", "tournament --pursuers random flee": "plays the evader, not",
    "exploit pursuer P_stage1 --attackers nobody": "--attackers",
    "exploit pursuer P_stage1 --tables t.safetensors e.safetensors": "no such file: 't.safetensors",
    "export still --to c --out a.c":
    "side = missing is not possible: it must be pursuer or evader, as 'still' plays either",
    "export flee --to c --out a.c --side pursuer": "side = pursuer",
    "export pursuer --to c --out a.c": "one arena, as office, since 'pursuer' plays in any",
    "export P_stage1 --to c --out a.onnx": "a file that ends in .c",
    "export P_stage1 --to onnx --out a.onnx --constants": "--constants",
    "export shielded:P_stage1 --to onnx --out a.onnx": "one without a shield",
    "export P_stage1 --to c --out a.c --game suite-v1/maze-00,maze-01": "one arena, which export needs",
    **{f"export P_stage1 --to c --out {one}.c": f"'{one}'" for one in ("1-2", "int", "main", "class", "NULL", "exp")},
}  # fmt: skip
"""What is refused, and with which words."""


SEVERAL = "suite-v1/maze-00,maze-01"
"""A game in two arenas."""
IN_ONE = (
    "simulate random random", "show random random", "evaluate random random --record 1", "regret random",
    "solve safety", "slice random --opponent 5 5", "exploit pursuer random", "play",
    "export P_curriculum --to c --out a.c",
)  # fmt: skip
REFUSED |= dict.fromkeys([f"{words} --game {SEVERAL}" for words in IN_ONE], "name one, as suite-v1/maze-00.")
REFUSED |= dict.fromkeys([f"pursuers {SEVERAL}", f"arena check {SEVERAL}"], "name one, as suite-v1/maze-00.")


@pytest.mark.parametrize("words", REFUSED)
def test_bad_arguments_are_refused(capsys, words):
    assert_refused(capsys, *words.split(), naming=[REFUSED[words]])


RUNS = dict.fromkeys(("mine/agents/P_one.safetensors", "runs/first/agents/P_one.safetensors"), "")
OLD = {"run/agents/P_stage1.safetensors": "precious", "run/config.toml": "sede = 3"}
"""A run that somebody may still need."""
AMONG_FILES = [
    (RUNS, "evaluate P_curriculu still", ["unknown agent 'P_curriculu'; did you mean 'P_curriculum'?"]),
    (RUNS, "evaluate evader still", ["PURSUER: 'evader' plays the evader, not the pursuer"]),
    (RUNS, "show pursuer shielded:zoo/pursuer", ["EVADER: 'shielded:zoo/pursuer' plays the pursuer, not the evader"]),
    (RUNS, "tournament --evaders intercept", ["--evaders: 'intercept' plays the pursuer"]),
    (RUNS, "evaluate mine still", ["unknown agent 'mine'; did you mean 'mine/P_one'?"]),
    (RUNS, "evaluate mine/P_two still", ["unknown agent 'mine/P_two'; did you mean 'mine/P_one'?"]),
    (RUNS, "evaluate runs/first still", ["unknown agent 'runs/first'; did you mean 'runs/first/P_one'?"]),
    (RUNS, "evaluate first/none still", ["unknown agent 'first/none'; did you mean 'first/P_one'?"]),
    (RUNS, "evaluate nowhere/P_one still", ["unknown agent 'nowhere/P_one'", "RUN/NAME"]),
    (OLD, "resume run", ["sede"]),
    ({"hall.toml": "seed = 1"}, "arena check HALL.TOML", ["no such file: 'HALL.TOML'"]),
    (OLD, "train --force --out run --config run/config.toml", ["sede"]),
    (OLD, "train --force --out run --stage self-play --vary pursuer=nobody", ["nobody"]),
    (OLD, "train --force --out run --stage self-play --vary pursuer=E_scratch", ["evader"]),
    (OLD, "train --force --out run --stage self-play --vary pursuer=P_scratch", ["encoded"]),
    ({"run/config.toml": "seed = 5"}, "train --config tiny.toml --out run", ["run"]),
    ({"thesis/a.tex": "A dark and stormy night."}, "train --config tiny.toml --out thesis --force", ["thesis"]),
    ({"notes.txt": "a regular file"}, "train --config tiny.toml --out notes.txt/run", ["notes.txt/run"]),
    ({"t.safetensors": "table"}, "exploit pursuer P_stage1 --tables t.safetensors t.safetensors",
     ["'t.safetensors' is not a whole Apollonius solution"]),
    ({"both.toml": f'scenario = "{SEVERAL}"\n[arena]\nx_max = 12.0\n'}, "evaluate random still --game both.toml",
     ["'both.toml': arena", "scenario"]),
    ({"drive.toml": "mas = 3.0"}, "simulate random still --drive drive.toml", ["drive.toml", "did you mean 'mass'"]),
    *[({"config.toml": text}, "train --config config.toml --out run", naming) for text, naming in (
        ('[algorithm]\nkind = "dqn"\nlearning_rat = 0.1', ["config.toml", "learning_rat", "'learning_rate'"]),
        ("learning_rate = 0.1", ["learning_rate", "move it to [algorithm]"]),
        ('[algorithm]\nkind = "dqn"\nbatch = 0', ["batch = 0", "more than 0"]),
        ("seed = ", ["config.toml", "no TOML"]),
    )],
]  # fmt: skip
"""Files, what is refused among them, and with which words."""


@pytest.mark.usefixtures("tiny")
@pytest.mark.parametrize(("files", "words", "naming"), AMONG_FILES)
def test_bad_input_is_refused_and_leaves_all_files_unchanged(capsys, files, words, naming):
    for name, text in files.items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(text, encoding="utf-8")
    assert_refused(capsys, *words.split(), naming=naming)


def test_random_arena_replaces_a_list_of_arenas():
    assert run_main("arena", "random", "--game", SEVERAL, "--seed", "3", "--out", "a.toml") == 0
    game = load_game(Path("a.toml"))
    assert game.scenario is None
    assert [float(disc.x) for disc in game.arena.discs] == [float(disc.x) for disc in random_arena("discs", 3).discs]


@pytest.mark.parametrize(
    ("variable", "value", "status", "line"),
    [
        ("JAX_PLATFORMS", "nope", 2, "JAX_PLATFORMS = nope is not possible"),
        ("JAX_ENABLE_X64", "1", 2, "JAX_ENABLE_X64 = true is not possible"),
        ("JAX_DEFAULT_PRNG_IMPL", "best", 2, 'JAX does not begin (Invalid value "best"'),
        ("PYTHONIOENCODING", "ascii:strict", 0, ""),
        ("PYTHONIOENCODING", "ascii:surrogateescape", 0, ""),  # as of the locale POSIX
    ],
)
@pytest.mark.slow
def test_unusual_environment_variables_are_refused_or_make_no_difference(monkeypatch, variable, value, status, line):
    monkeypatch.setenv(variable, value)
    said = run_process(
        "import sys; from apollonius.cli.main import main; sys.exit(main())",
        "tournament", "--pursuers", "random", "--evaders", "still", "--games", "2",
    )  # fmt: skip
    assert said.returncode == status, said.stderr
    assert line in said.stderr
    assert "Traceback" not in said.stderr
    if status == 0:
        assert " ? " in said.stdout  # for plus or minus


def test_xla_warnings_of_long_compilations_are_silenced(monkeypatch):
    monkeypatch.delenv("TF_CPP_MIN_LOG_LEVEL", raising=False)
    asks = "import os; from apollonius.__main__ import main; main(); print(os.environ['TF_CPP_MIN_LOG_LEVEL'])"
    assert run_process(asks).stdout.endswith("\n3\n")


@pytest.mark.parametrize(
    ("module", "words", "extra"),
    [
        ("matplotlib", "arena check office --out office.png", "plot"),
        ("ray", "reproduce --on ray", "ray"),
        ("submitit", "train --on slurm", "slurm"),
        ("tensorboardX", "train --track tensorboard", "track"),
        ("tensorboardX", f"track {REPOSITORY}/docs/results/demo --to tensorboard", "track"),
        ("mujoco", "simulate random still", "sim"),
    ],
)
def test_missing_libraries_are_named_before_any_work(capsys, monkeypatch, module, words, extra):
    monkeypatch.setitem(sys.modules, module, None)
    assert_refused(capsys, *words.split(), naming=["pip install", f"the extra '{extra}'"])


def test_extras_match_pyproject():
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    for extra, modules in EXTRAS.items():
        wanted = [re.match(r"[\w-]+", one)[0] for one in project["optional-dependencies"][extra]]
        assert wanted == list(modules.values())


def test_interface_without_its_library_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pettingzoo", None)
    with pytest.raises(InvalidInput, match="the extra 'gym'"):
        _ = apollonius.parallel_env


def test_open_spiel_without_its_library_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyspiel", None)
    monkeypatch.delitem(sys.modules, "apollonius.envs.open_spiel", raising=False)
    with pytest.raises(InvalidInput, match=r"pip install open_spiel \(the extra 'openspiel'\)"):
        importlib.import_module("apollonius.envs.open_spiel")


def test_train_makes_and_evaluates_a_run_and_force_replaces_its_files(tiny, capsys, monkeypatch):
    """Only a run's own files are replaced."""
    monkeypatch.setattr("apollonius.evaluate.pairings.JUDGED_GAMES", 200)
    arguments = ["train", "--config", tiny, "--stage", "fixed-target", "--seed", "7", "--out", "run"]
    assert run_main(*arguments) == 0
    printed = capsys.readouterr()
    assert "P_stage1 (pursuer) wins " in printed.out
    wrote, then = printed.err.splitlines()[-2:]
    assert wrote.startswith("wrote run (")
    assert then == "next: apollonius report run"
    assert set(json.loads(Path("run/evaluation.json").read_text(encoding="utf-8"))) == {"P_stage1 against still"}

    Path("run/notes.txt").write_text("mine", encoding="utf-8")
    Path("run/report.html").write_text("of the run before", encoding="utf-8")
    monkeypatch.setattr("apollonius.learn.run.TrainingRun.execute", lambda run: False)
    assert run_main(*arguments, "--force") == 130
    left = {str(path.relative_to("run")) for path in Path("run").rglob("*") if path.is_file()}
    assert left == {"config.toml", "notes.txt"}


def test_stopped_run_prints_its_resume_command_and_seed_0_is_kept(tiny, capsys, monkeypatch):
    monkeypatch.setattr("apollonius.learn.run.TrainingRun.execute", lambda run: False)
    for asked, seed in (([], 5), (["--seed", "0"], 0)):
        assert main(["train", "--config", tiny, *asked, "--out", f"run-{seed}"]) == 130
        assert f"\nseed = {seed}\n" in "\n" + Path(f"run-{seed}/config.toml").read_text(encoding="utf-8")
        assert capsys.readouterr().err.splitlines()[-1] == f"stopped; go on with: apollonius resume run-{seed}"


def test_resume_skips_finished_and_evaluated_runs_of_a_sweep(tiny, capsys, monkeypatch):
    asked, runs = [], [f"sweep/seed={seed}" for seed in (1, 2, 3)]
    monkeypatch.setattr("apollonius.cli.runs.run_jobs", lambda jobs, *_: asked.extend(job.name for job in jobs))
    assert main(["train", "--config", tiny, "--seeds", "1-3", "--out", "sweep"]) == 0
    assert asked == runs
    for run in runs[:2]:
        Path(run, "state.json").write_text('{"state": "finished"}', encoding="utf-8")
    Path(runs[0], "evaluation.json").write_text("{}", encoding="utf-8")
    asked.clear()
    assert main(["resume", "sweep"]) == 0
    assert asked == runs[1:]
    response = '[algorithm]\nkind = "ppo"\n[[stages]]\nkind = "response"\n'
    Path(runs[1], "config.toml").write_text(response, encoding="utf-8")
    asked.clear()
    assert main(["resume", "sweep"]) == 0
    assert asked == runs[2:], "one side that learned alone is not judged"


def test_runs_lists_malformed_runs_without_control_characters(capsys):
    line = {
        "stage": "response",
        "env_steps": 8,
        "episodes": 1,
        "updates": 1,
        "seconds": 1.0,
        "losses": {"pursuer": 0.1},
    }
    line |= {"env_steps_per_second": 8, "outcomes": counts_by_name([0] * 9), "pursuer_return": 0, "evader_return": 0}
    odd = {
        "process": ("state.json", {"state": "running", "machine": platform.node(), "process": 99999999999}),
        "stage": ("metrics.jsonl", line),
        "word\x1b[2J": (
            "state.json",
            {"state": "failed", "machine": "m\x1b]0;x\x07", "error": "\x1b[31mred\nrun finished"},
        ),
        "sound": ("metrics.jsonl", line | {"stage": "self-play"}),
    }
    for name, (file, record) in odd.items():
        Path("runs", name).mkdir(parents=True)
        Path("runs", name, "config.toml").write_text('[[stages]]\nkind = "self-play"', encoding="utf-8")
        Path("runs", name, file).write_text(json.dumps(record) + "\n", encoding="utf-8")
    os.utime("runs/sound/metrics.jsonl", (2**40, 2**40))
    assert run_main("runs") == 0
    lines = capsys.readouterr().out.removesuffix("\n").split("\n")
    assert all(line.isprintable() for line in lines)
    states = {line.split()[0]: line.split()[1] for line in lines[1:5]}
    assert states == {"process": "failed", "sound": "waiting", "stage": "failed", "word\\x1b[2J": "failed"}
    assert "process = 99999999999 is not possible" in lines[5]
    assert "stage = response is not possible: it must be one of this training, self-play" in lines[6]
    assert lines[7].endswith(": \\x1b[31mred run finished")


def test_resume_refuses_a_pipe_in_place_of_metrics(capsys):
    Path("run").mkdir()
    Path("run/config.toml").write_text("seed = 3", encoding="utf-8")
    os.mkfifo("run/metrics.jsonl")
    assert_refused(capsys, "resume", "run", naming=["cannot use: File or stream is not seekable"])


def test_simulate_prints_both_matches_and_records_games(capsys):
    pytest.importorskip("mujoco", reason="needs mujoco: pip install mujoco")
    Path("short.toml").write_text("max_steps = 15\n", encoding="utf-8")
    words = "simulate pure-pursuit flee --games 3 --game short.toml --record 1"
    assert run_main(*words.split()) == 0
    said = capsys.readouterr().out
    assert "pure-pursuit (pursuer) against flee (evader), 3 games, starts: rest" in said
    assert "by the rules  with bodies" in said
    assert "no result" in said
    (replay,) = Path("replays").iterdir()
    assert load_replay(replay).outcome == Outcome.NO_RESULT


def test_full_disk_ends_the_training_with_one_line(tiny, capsys, monkeypatch):
    """The config and the state still find room; the checkpoint at the end of the stage does not."""
    fsync, written = os.fsync, []

    def fail_after_the_state(number):
        written.append(number)
        if len(written) > 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(number)

    monkeypatch.setattr(os, "fsync", fail_after_the_state)
    assert run_main("train", "--config", tiny, "--stage", "fixed-target", "--out", "run") == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.splitlines()[-1] == (
        "apollonius train: cannot use 'run/checkpoint.safetensors': No space left on device; make room on the disk, "
        "then go on with: apollonius resume run"
    )
    assert not list(Path("run").rglob("*.tmp"))


def run_json(capsys, *arguments):
    capsys.readouterr()
    assert run_main(*arguments, "--json") == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_regret_measures_a_card(capsys):
    for role in ("pursuer", "evader"):
        words = f"solve game --role {role} --grid 4x4x2x4 --hold 10 --out {role}.safetensors"
        assert run_main(*words.split()) == 0
    files = ("--tables", "evader.safetensors", "pursuer.safetensors")
    card = run_json(capsys, "regret", "random", *files, "--role", "evader", "--games", "12")
    assert (card["agent"], card["role"], card["games"]) == ("random", "evader", 12)
    assert card["gap"] == pytest.approx(card["promised"] - card["payoff"], abs=1e-6)
    assert_refused(capsys, "regret", "random", *files[:2], files[1], naming=("--tables", "a pursuer's and an evader's"))
    assert_refused(capsys, "regret", "random", *files, "--grid", "4x4x2x4", naming=("--grid", "--tables"))
    assert run_main("regret", "still", *files, "--role", "evader", "--games", "5") == 0
    assert "gap to what its own table promises" in capsys.readouterr().out


@pytest.mark.slow
def test_solve_reach_computes_a_table_once_and_then_loads_it(capsys, monkeypatch):
    coarse = "--grid", "9x9x3x8"
    arguments = ("solve", "reach", *coarse, "--out", "tables/six.safetensors", "--target", "6")
    monkeypatch.setattr("apollonius.evaluate.solved.STARTS", 500)
    first = run_json(capsys, *arguments, "2")
    assert first["starts with a capture"] > 0.2
    assert first["median time to capture [s]"] > 3
    with monkeypatch.context() as patch:
        patch.setattr("apollonius.solve.solving.solve_reach", None)
        assert run_json(capsys, *arguments, "2") == first
    assert_refused(capsys, *arguments, "3", naming=("tables/six.safetensors", "another problem", "--force"))
    assert_refused(capsys, *arguments, "3", "--whole-cells", naming=("whole_cells = true", "all but game"))
    Path("t.safetensors").write_text("mine", encoding="utf-8")
    safety = ("solve", "safety", *coarse, "--out", "t.safetensors")
    assert_refused(capsys, *safety, naming=("t.safetensors", "not a whole"))
    assert run_main(*arguments, "3", "--force") == 0
    assert load_solution(Path("tables/six.safetensors")).problem.target == [6.0, 3.0]


@pytest.mark.slow
def test_one_obstacle_needs_two_pursuers(capsys):
    facts = run_json(capsys, "pursuers", "one-large")
    assert (facts["pursuers"], facts["agree"], facts["islands"]) == (2, True, 1)
    assert [graph["islands_seen"] for graph in facts["graphs"]] == [1, 1, 1]
    assert [round(graph["turned_degrees"]) for graph in facts["graphs"]] == [30, 0, 30]
    seen = run_json(capsys, "pursuers", "one-large", "--to-see")
    assert (seen["pursuers"], seen["agree"]) == (2, True)
    assert np.shape(seen["strategy"]) == (seen["graphs"][-1]["turns"] + 1, 2, 2)


def test_arena_without_obstacles_needs_one_pursuer(capsys):
    Path("empty.toml").write_text("[arena]\ndiscs = []\n", encoding="utf-8")
    assert run_main("pursuers", "empty.toml") == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "empty.toml: 1 pursuer is enough, for idealised robots on this graph"
    assert len(said) == 6
