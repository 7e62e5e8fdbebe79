"""The command: what it prints, and that it refuses bad input in one line and leaves everything as it was."""

import errno
import json
import os
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import jax
import pytest
import tomli_w
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

import apollonius
from apollonius.agents.network import make_network
from apollonius.agents.store import describe, save_agent
from apollonius.arenas.file import load_game
from apollonius.arenas.random_arena import random_arena
from apollonius.arenas.record import to_dict
from apollonius.cli.main import COMMANDS, main
from apollonius.game.dynamics import Unicycle
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import EXTRAS, InvalidInput
from apollonius.play.replay import load_replay
from tests.learn.tiny import RUN

REPOSITORY = Path(__file__).parents[2]
OUTCOMES = (
    "captured",
    "pursuer_hit_obstacle",
    "evader_hit_obstacle",
    "pursuer_out_of_range",
    "evader_out_of_range",
    "both_failed",
    "no_result",
)


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    """And with the promotion that optax needs."""
    monkeypatch.chdir(tmp_path)
    with jax.numpy_dtype_promotion("standard"):
        yield


@pytest.fixture
def tiny(tmp_path):
    """A config file of a training that takes seconds, of robots that can stop: no start at rest is lost."""
    game = replace(RUN.game, pursuer=Unicycle(), evader=Unicycle())
    Path("tiny.toml").write_text(tomli_w.dumps(to_dict(replace(RUN, game=game))))
    return "tiny.toml"


@pytest.fixture
def agent():
    """Files of a pursuer and an evader: `P.safetensors` and `E.safetensors`."""
    for name, role in (("P", Role.PURSUER), ("E", Role.EVADER)):
        network = make_network("paper", 4, 1, jax.random.key(0))
        save_agent(describe(network, role, to_dict(make_game("paper")), {}), Path(f"{name}.safetensors"))


def run_main(*arguments):
    """The exit status of the command."""
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
    """Every file and folder, with its content."""
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
    for what in naming:
        assert what in printed.err
    assert everything_here() == before


def test_a_reader_that_leaves_early_is_no_error():
    closing_first = "import os, sys; os.close(os.dup(1)); r, w = os.pipe(); os.dup2(w, 1); os.close(w); os.close(r);"
    command = "from apollonius.cli.main import main; sys.exit(main(sys.argv[1:]))"
    result = run_process(f"{closing_first} {command}", "arena", "list")
    assert (result.returncode, result.stderr) == (1, "")


@pytest.mark.parametrize(("option", "says"), [("--help", "train"), ("--version", "apollonius 0.1.0\n")])
def test_help_and_version_import_nothing_that_takes_time(option, says):
    result = run_process(
        "import atexit, sys\n"
        "from apollonius.cli.main import main\n"
        "heavy = ('jax', 'numpy', 'matplotlib', 'scipy', 'scipy.stats', 'equinox', 'optax', 'rich')\n"
        "atexit.register(lambda: print('imported:', [name for name in heavy if name in sys.modules]))\n"
        f"main(['{option}'])"
    )
    assert result.returncode == 0
    assert says in result.stdout
    assert result.stdout.endswith("imported: []\n")


def test_help_names_every_command_once_under_what_it_is_for(capsys):
    assert run_main("--help") == 0
    lines = capsys.readouterr().out.splitlines()
    headings = [line for line in lines if line.endswith(":") and not line.startswith(" ")]
    assert headings[1:] == [f"{purpose}:" for purpose in COMMANDS]
    named = [line.split()[0] for line in lines if line.startswith("  ") and not line.strip().startswith("-")]
    assert len(named) == len(set(named)) == sum(map(len, COMMANDS.values()))
    assert max(map(len, lines)) <= 100


def test_evaluate_prints_one_json_object_or_a_table(capsys):
    assert run_main("evaluate", "random", "random", "--games", "200", "--seed", "3", "--json") == 0
    printed = capsys.readouterr()
    assert printed.out.count("\n") == 1
    result = json.loads(printed.out)
    assert result["games"] == 200
    assert set(result["outcomes"]) == set(OUTCOMES)
    assert sum(result["outcomes"].values()) == 200
    wins = sum(result["outcomes"][name] for name in ("captured", "evader_hit_obstacle", "evader_out_of_range"))
    assert result["pursuer_win_rate"] == wins / 200
    for side in ("pursuer", "evader"):
        low, high = result[f"{side}_win_interval"]
        assert 0 <= low <= result[f"{side}_win_rate"] <= high <= 1
    assert result["mean_steps"] > 1
    match = [result[name] for name in ("pursuer", "evader", "game", "starts", "seed")]
    assert match == ["random", "random", "paper", "rest", 3]
    assert run_main("evaluate", "random", "random", "--games", "200", "--seed", "3") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "random (pursuer) against random (evader), 200 games, starts: rest"
    told = {words[0].strip(): int(words[-2]) for words in (line.rsplit(maxsplit=2) for line in lines[1:8])}
    assert told == {name.replace("_", " "): count for name, count in result["outcomes"].items()}


def test_evaluate_records_the_games_that_the_pursuer_lost_first(capsys):
    assert run_main("evaluate", "random", "random", "--games", "30", "--seed", "4", "--record", "3", "--json") == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["games"] == 30
    told = printed.err.splitlines()
    assert {line.split(" (")[0] for line in told} == {f"wrote {path}" for path in Path("replays").iterdir()}
    replays = [load_replay(path) for path in Path("replays").iterdir()]
    assert len({replay.index for replay in replays}) == 3
    assert {replay.outcome for replay in replays} <= {Outcome.PURSUER_HIT_OBSTACLE, Outcome.PURSUER_OUT_OF_RANGE}
    assert all(replay.first_difference() is None for replay in replays)


@pytest.mark.slow
def test_show_writes_one_game_in_every_form(capsys):
    assert run_main("show", "shielded:random", "random", "--seed", "7", "--out", "new/game.json") == 0
    told = capsys.readouterr().out
    replay = load_replay(Path("new/game.json"))
    assert told.startswith("shielded:random against random: ")
    assert replay.outcome.name.lower().replace("_", " ") in told
    for name, speed in (("game.png", []), ("game.gif", ["--speed", "4"])):
        assert run_main("show", "new/game.json", "--out", name, *speed) == 0
        size = Path(name).stat().st_size
        assert capsys.readouterr().err.splitlines()[0] == f"wrote {name} ({size / 1000:.0f} kB)"
    assert run_main("show", "shielded:random", "random", "--seed", "7", "--out", "again.json") == 0
    assert Path("again.json").read_bytes() == Path("new/game.json").read_bytes()
    capsys.readouterr()
    changed = json.loads(Path("again.json").read_text())
    changed["states"][5][0] += 1e-3
    Path("changed.json").write_text(json.dumps(changed))
    assert run_main("show", "changed.json", "--out", "game.gif") == 0
    assert "differs from step 5 on" in capsys.readouterr().err


def test_slice_draws_an_agent_of_either_side_and_one_that_reads_a_chart(agent, capsys):
    for name in ("E.safetensors", "P_any"):
        assert run_main("slice", name, "--opponent", "5", "5", "--opponent-speed", "1.2", "--out", "new/s.png") == 0
        told = capsys.readouterr().err.splitlines()
        assert told[0].startswith("wrote new/s.png (")
        assert told[1].startswith("next: apollonius show ")
        assert name in told[1].split()
        assert Path("new/s.png").read_bytes().startswith(b"\x89PNG")
        Path("new/s.png").unlink()


@pytest.mark.parametrize(
    ("arguments", "naming"),
    [
        (["fly"], ["fly", "--help"]),
        (["trian"], ["trian", "did you mean 'train'"]),
        (["train", "--preset", "quik"], ["quik", "did you mean 'quick'"]),
        (["evaluate", "P_pol", "still"], ["P_pol", "did you mean 'P_pool'"]),
        (["evaluate", "P_pool", "still", "--game", "ofice"], ["ofice", "did you mean 'office'"]),
        (["evaluate", "P_pool", "still", "--game", "team-3v1/ofice"], ["ofice", "did you mean 'office'"]),
        (["train", "--game", "chess"], ["chess", "paper", "four-small", "one-large", "zero-sum"]),
        (["train", "--stage", "fixed-target", "--evader", "nobody"], ["nobody", "random", "still"]),
        (["train", "--stage", "fixed-target", "--evader", "random", "still"], ["random, still", "trained agents"]),
        (["train", "--evader", "random"], ["evaders = random", "fixed-target"]),
        (["train", "--stage", "self-play", "--evader", "E_scratch", "random"], ["E_scratch, random", "one agent"]),
        (["train", "--stage", "self-play", "--evader", "random"], ["no agent is called 'random'", "E_scratch"]),
        (["evaluate", "random", "still", "--games", "5", "--record", "6"], ["--record = 6", "--games = 5"]),
        (["show", "random", "still", "--out", "game.avi"], ["game.avi", ".png", ".gif", ".json"]),
        (["show", "random", "still", "--out", "game.png", "--speed", "2"], ["--speed = 2", ".gif, .webp, .mp4"]),
        (["show", "random", "still", "--out", "game.gif", "--speed", "0"], ["--speed = 0", "0.05 to 100"]),
        (["show", "nowhere.json"], ["nowhere.json", "check the path"]),
        (["report", "."], ["RUN = .", "the folder of a training run"]),
        (["slice", "nobody", "--opponent", "5", "5"], ["nobody", "P_curriculum", ".safetensors"]),
        (["slice", "random", "--opponent", "5", "5"], ["random", "P_curriculum"]),
        (["slice", "P_stage1", "--opponent", "3", "3"], ["opponent = (3.0, 3.0)", "discs"]),
        (["slice", "P_stage1", "--opponent", "5", "5", "--speed", "2", "--out", "new/s.png"], ["speed = 2", "1.2 m"]),
        (["show", "shielded:nobody", "still"], ["nobody", "random"]),
        (["evaluate", "nobody", "still"], ["nobody", "random", "still", ".safetensors"]),
        (["evaluate", "random", "still", "--game", "chess"], ["chess", "paper", "zero-sum"]),
        (["evaluate", "random"], ["EVADER"]),
    ],
    ids=" ".join,
)
def test_bad_arguments_are_refused(capsys, arguments, naming):
    assert_refused(capsys, *arguments, naming=naming)


SEVERAL = "suite-v1/maze-00,maze-01"
"""A game in two arenas."""


@pytest.mark.parametrize(
    "words",
    [
        f"simulate random random --game {SEVERAL}",
        f"show random random --game {SEVERAL}",
        f"evaluate random random --record 1 --game {SEVERAL}",
        f"regret random --game {SEVERAL}",
        f"solve safety --game {SEVERAL}",
        f"slice random --opponent 5 5 --game {SEVERAL}",
        f"exploit pursuer random --game {SEVERAL}",
        f"play --game {SEVERAL}",
        f"export P_pool --to c --out a.c --game {SEVERAL}",
        f"pursuers {SEVERAL}",
        f"arena check {SEVERAL}",
    ],
)
def test_what_needs_one_arena_refuses_several_before_it_works(capsys, words):
    assert_refused(capsys, *words.split(), naming=[f"game = {SEVERAL}", "name one, as suite-v1/maze-00."])


def test_a_random_arena_in_place_of_several_is_the_one_that_is_played(capsys):
    assert run_main("arena", "random", "--game", SEVERAL, "--seed", "3", "--out", "a.toml") == 0
    game = load_game(Path("a.toml"))
    assert game.scenario is None
    assert [float(disc.x) for disc in game.arena.discs] == [float(disc.x) for disc in random_arena("discs", 3).discs]
    capsys.readouterr()
    assert_refused(capsys, "arena", "random", "--game", "suite-v1/train", "--out", "b.toml", naming=["several kinds"])
    Path("both.toml").write_text(f'scenario = "{SEVERAL}"\n[arena]\nx_max = 12.0\n')
    assert_refused(
        capsys, "evaluate", "random", "still", "--game", "both.toml", naming=["'both.toml': arena", "scenario"]
    )


def test_the_command_alone_prints_what_there_is(capsys):
    assert run_main() == 0
    printed = capsys.readouterr()
    assert "evaluate" in printed.out
    assert printed.err == ""


@pytest.mark.parametrize(
    ("variable", "value", "status", "line"),
    [
        ("JAX_PLATFORMS", "nope", 2, "JAX_PLATFORMS = nope is not possible"),
        ("JAX_ENABLE_X64", "1", 2, "JAX_ENABLE_X64 = True is not possible"),
        ("PYTHONIOENCODING", "ascii:strict", 0, ""),
    ],
)
@pytest.mark.slow
def test_an_odd_environment_is_refused_or_makes_no_difference(monkeypatch, variable, value, status, line):
    monkeypatch.setenv(variable, value)
    said = run_process(
        "import sys; from apollonius.__main__ import main; sys.exit(main())",
        "tournament", "--pursuers", "random", "--evaders", "still", "--games", "2",
    )  # fmt: skip
    assert said.returncode == status, said.stderr
    assert line in said.stderr
    assert "Traceback" not in said.stderr
    if status == 0:
        assert " ? " in said.stdout  # for plus or minus


@pytest.mark.parametrize(
    ("modules", "arguments", "extra"),
    [
        (["imageio_ffmpeg"], ["show", "random", "still", "--out", "game.mp4"], "video"),
        (["matplotlib"], ["arena", "check", "paper", "--out", "a.png"], "plot"),
        (["ray"], ["exploit", "pursuer", "P_pool", "--on", "ray"], "ray"),
        (["mujoco"], ["simulate", "random", "still"], "sim"),
        (["jinja2"], ["report", "."], "plot"),
    ],
    ids=lambda value: value if isinstance(value, str) else " ".join(value),
)
def test_libraries_that_are_missing_are_named_before_any_work(capsys, monkeypatch, modules, arguments, extra):
    for module in modules:
        monkeypatch.setitem(sys.modules, module, None)
    assert_refused(capsys, *arguments, naming=["pip install", f"the extra '{extra}'"])


def test_the_extras_are_those_of_the_package():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    for extra, modules in EXTRAS.items():
        wanted = [re.match(r"[\w-]+", one)[0] for one in project["optional-dependencies"][extra]]
        assert wanted == list(modules.values())


def test_an_interface_without_its_library_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pettingzoo", None)
    with pytest.raises(InvalidInput, match="the extra 'gym'"):
        _ = apollonius.parallel_env


def test_a_full_disk_names_the_file_and_how_to_go_on(capsys, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "a.toml.tmp")

    monkeypatch.setattr(os, "replace", full)
    assert_refused(capsys, "arena", "random", "--out", "a.toml", naming=["'a.toml'", "No space left", "make room"])


def test_damaged_agents_are_refused(agent, capsys):
    path = Path("P.safetensors")
    with safe_open(path, framework="numpy") as file:
        metadata = file.metadata()
    metadata["header"] = metadata["header"].replace('"observation": "paper"', '"observation": "lidar"')
    save_file(load_file(path), "lidar.safetensors", metadata)
    path.write_bytes(path.read_bytes()[:-100])
    for name, naming in (("P.safetensors", "not a whole"), ("lidar.safetensors", "lidar")):
        assert_refused(capsys, "evaluate", name, "still", naming=[name, naming])


def test_an_agent_on_the_wrong_side_is_refused(agent, capsys):
    assert_refused(capsys, "evaluate", "random", "P.safetensors", naming=["P.safetensors", "plays the pursuer"])
    assert_refused(capsys, "evaluate", "E.safetensors", "still", naming=["E.safetensors", "plays the evader"])


@pytest.mark.parametrize(
    ("config", "naming"),
    [
        ("[dqn]\nlearning_rat = 0.1", ["config.toml", "learning_rat", "'learning_rate'"]),
        ("sede = 3", ["sede", "'seed'"]),
        ("[game.pursuer]\nv_maximum = 2.0", ["v_maximum", "'v_max'"]),
        ("learning_rate = 0.1", ["learning_rate", "move it to [dqn] or [sac]"]),
        ("[dqn]\nseed = 1", ["seed", "move it to the top"]),
        ("[dqn]\nwidth = 'wide'", ["width"]),
        ("[dqn]\nbatch = 0", ["batch = 0", "more than 0"]),
        ("[game]\ndt = -0.1", ["dt = -0.1", "more than 0"]),
        ("stages = 'third'", ["stages"]),
        ("seed = ", ["config.toml", "no TOML"]),
    ],
    ids=["misspelt", "top", "game", "moved", "moved-to-top", "type", "value", "game-value", "choice", "syntax"],
)
def test_a_bad_config_is_refused(capsys, config, naming):
    Path("config.toml").write_text(config)
    assert_refused(capsys, "train", "--config", "config.toml", "--out", "run", naming=naming)


@pytest.mark.parametrize(
    ("file", "text", "out", "force"),
    [
        ("run/config.toml", "seed = 5", "run", []),
        ("thesis/chapter1.tex", "It was a dark and stormy night.", "thesis", []),
        ("thesis/chapter1.tex", "It was a dark and stormy night.", "thesis", ["--force"]),
        ("notes.txt", "a regular file", "notes.txt", []),
        ("notes.txt", "a regular file", "notes.txt/run", []),
    ],
)
def test_a_folder_that_holds_something_else_is_refused(tiny, capsys, file, text, out, force):
    Path(file).parent.mkdir(exist_ok=True)
    Path(file).write_text(text)
    assert_refused(capsys, "train", "--config", tiny, "--out", out, *force, naming=[out])


@pytest.fixture
def old_run():
    """A run that somebody may still need."""
    Path("run/agents").mkdir(parents=True)
    Path("run/agents/P_stage1.safetensors").write_bytes(b"precious")
    Path("run/config.toml").write_text("sede = 3")


OVERWRITE = ["train", "--force", "--out", "run"]


@pytest.mark.usefixtures("old_run", "agent")
@pytest.mark.parametrize(
    ("arguments", "naming"),
    [
        (["resume", "run"], ["sede"]),
        (["train", "--force", "--out", "run", "--config", "run/config.toml"], ["sede"]),
        (["train", "--force", "--out", "run", "--preset", "huge"], ["huge"]),
        (["train", "--force", "--out", "run", "--stage", "self-play", "--pursuer", "nobody"], ["nobody"]),
        (["train", "--force", "--out", "run", "--stage", "self-play", "--pursuer", "E.safetensors"], ["evader"]),
        (
            ["train", "--force", "--out", "run", "--stage", "self-play", "--pursuer", "P.safetensors"],
            ["paper", "encoded"],
        ),
    ],
    ids=["resume", "config", "preset", "unknown pursuer", "an evader as pursuer", "a pursuer with other eyes"],
)
def test_bad_input_never_costs_an_old_run(capsys, arguments, naming):
    assert_refused(capsys, *arguments, naming=naming)


def test_train_makes_a_run_and_judges_it_and_force_replaces_it(tiny, capsys, monkeypatch):
    """Only a run's own files are replaced."""
    monkeypatch.setattr("apollonius.cli.train._JUDGED_GAMES", 200)
    arguments = ["train", "--config", tiny, "--stage", "fixed-target", "--seed", "7", "--out", "run"]
    assert run_main(*arguments) == 0
    printed = capsys.readouterr()
    assert "P_stage1 (pursuer) against still (evader)" in printed.out
    wrote, then = printed.err.splitlines()[-2:]
    assert wrote.startswith("wrote run (")
    assert then == "next: apollonius report run"
    assert set(json.loads(Path("run/evaluation.json").read_text())) == {"P_stage1 against still"}
    agent = Path("run/agents/P_stage1.safetensors").read_bytes()
    metrics = Path("run/metrics.jsonl").read_text().splitlines()

    Path("run/notes.txt").write_text("mine")
    Path("run/report.html").write_text("of the run before")
    assert run_main(*arguments, "--force") == 0
    assert not Path("run/report.html").exists()
    assert Path("run/agents/P_stage1.safetensors").read_bytes() == agent
    assert len(Path("run/metrics.jsonl").read_text().splitlines()) == len(metrics)
    assert Path("run/notes.txt").read_text() == "mine"


INTERRUPTED = """
import os, signal, sys
import apollonius.learn.run
from apollonius.cli.main import main

measure = apollonius.learn.run.measure

def measure_and_interrupt(*arguments):
    progress = measure(*arguments)
    if progress.env_steps == 2 * 8192:
        os.kill(os.getpid(), signal.SIGINT)
    return progress

apollonius.learn.run.measure = measure_and_interrupt
sys.exit(main())
"""


def test_seed_0_is_a_seed(monkeypatch):
    """And not the lack of one: it takes the place of the config's own."""
    monkeypatch.setattr("apollonius.learn.run.Run.execute", lambda run: False)
    Path("five.toml").write_text(tomli_w.dumps(to_dict(replace(RUN, seed=5))))
    for asked, seed in (([], 5), (["--seed", "0"], 0)):
        assert main(["train", "--config", "five.toml", *asked, "--out", f"run-{seed}"]) == 130
        assert f"\nseed = {seed}\n" in "\n" + Path(f"run-{seed}/config.toml").read_text()


@pytest.mark.slow
def test_ctrl_c_leaves_a_checkpoint_and_resume_finishes(tiny, capsys):
    arguments = ["train", "--config", tiny, "--stage", "fixed-target", "--out", "run"]
    stopped = run_process(INTERRUPTED, *arguments)
    assert stopped.returncode == 130
    assert stopped.stdout == ""
    assert stopped.stderr.splitlines()[-1] == "stopped; go on with: apollonius resume run"
    assert Path("run/checkpoint.safetensors").is_file()
    assert len(Path("run/metrics.jsonl").read_text().splitlines()) == 2

    assert run_main("resume", "run") == 0
    assert "P_stage1 (pursuer) against still (evader)" in capsys.readouterr().out
    assert len(Path("run/metrics.jsonl").read_text().splitlines()) == 4


def test_a_full_disk_ends_the_training_in_one_line(tiny, capsys, monkeypatch):
    """The config still finds room; the checkpoint at the end of the stage does not."""
    fsync, written = os.fsync, []

    def fail_after_the_config(number):
        written.append(number)
        if len(written) > 1:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(number)

    monkeypatch.setattr(os, "fsync", fail_after_the_config)
    assert run_main("train", "--config", tiny, "--stage", "fixed-target", "--out", "run") == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.splitlines()[-1] == (
        "apollonius train: cannot use 'run/checkpoint.safetensors': No space left on device; make room on the disk, "
        "then go on with: apollonius resume run"
    )
    assert not list(Path("run").rglob("*.tmp"))
