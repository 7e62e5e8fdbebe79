"""A training run in its folder: what it leaves there, and that stopping it in any way changes nothing."""

import errno
import json
import os
import signal
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import load, save

from apollonius.agents.network import make_network
from apollonius.agents.store import describe, load_agent, save_agent
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.learn import curriculum
from apollonius.learn import run as run_module
from apollonius.learn.checkpoint import FORMAT, load_stand
from apollonius.learn.folder import create_run, held, load_config
from apollonius.learn.opponents import OpponentConfig
from apollonius.learn.run import Run
from apollonius.play.playout import Results
from tests.learn.tiny import CHUNK, DQN, GAME, RUN

REPOSITORY = Path(__file__).parents[2]
CHECKPOINT = "checkpoint.safetensors"
TIMES = ("seconds", "env_steps_per_second")
"""What a metrics line says about the clock; everything else in it must come out the same."""
CURRICULUM = [f"{side}_curriculum{part}" for side in "EP" for part in ("", "-25", "-50", "-75")]


def begin(folder, config=RUN):
    create_run(config, folder)
    return folder


def metrics(folder):
    lines = [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]
    return [{name: value for name, value in line.items() if name not in TIMES} for line in lines]


def agents(folder):
    return {path.stem: path.read_bytes() for path in sorted((folder / "agents").iterdir())}


def stop_after(chunks):
    """Asked after every chunk, says stop after this many."""
    asked = iter(range(1, 1000))
    return lambda: next(asked) == chunks


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """The folder of a run of both stages, four chunks each, that nothing disturbed."""
    folder = begin(tmp_path_factory.mktemp("run") / "uninterrupted")
    assert Run(RUN, folder).execute()
    return folder


@pytest.fixture
def checkpoint_after_every_chunk(monkeypatch):
    monkeypatch.setattr(run_module, "CHECKPOINT_SECONDS", 0.0)


def assert_same_end(folder, uninterrupted):
    assert agents(folder) == agents(uninterrupted)
    assert metrics(folder) == metrics(uninterrupted)


def test_a_run_leaves_its_config_metrics_checkpoint_and_agents(uninterrupted):
    assert sorted(path.name for path in uninterrupted.iterdir()) == [
        "agents",
        "checkpoint.safetensors",
        "config.toml",
        "metrics.jsonl",
    ]
    assert sorted(agents(uninterrupted)) == [*CURRICULUM, "P_stage1"]
    assert load_config(uninterrupted / "config.toml") == RUN


def test_every_chunk_has_a_line_of_metrics(uninterrupted):
    lines = metrics(uninterrupted)
    assert [(line["stage"], line["env_steps"]) for line in lines] == [
        (stage, chunk * CHUNK) for stage in ("fixed-target", "self-play") for chunk in (1, 2, 3, 4)
    ]
    for stage in (lines[:4], lines[4:]):
        finished = np.cumsum([sum(line["outcomes"].values()) for line in stage])
        assert [line["episodes"] for line in stage] == finished.tolist()
        assert [line["updates"] for line in stage] == [0, 0, 72, 200]
        assert [line["evaluation"]["env_steps"] for line in stage] == [line["env_steps"] for line in stage]
        assert {sum(line["evaluation"]["outcomes"].values()) for line in stage} == {RUN.self_play.evaluation_games}
    assert set(lines[0]["losses"]) == {"pursuer"}
    assert set(lines[4]["losses"]) == {"pursuer", "evader"}


def test_agents_say_how_they_were_trained(uninterrupted):
    for name, stage, env_steps in [("E_curriculum-25", "self-play", CHUNK), ("P_curriculum", "self-play", 4 * CHUNK)]:
        header = load_agent(uninterrupted / "agents" / f"{name}.safetensors").header
        assert header.role == {"E": "evader", "P": "pursuer"}[name[0]]
        assert header.training["seed"] == RUN.seed
        assert header.training["stage"] == stage
        assert header.training["env_steps"] == env_steps
        assert header.game["capture_distance"] == GAME.capture_distance
        assert header.training["config"]["dqn"]["width"] == DQN.width


def test_a_run_stopped_in_both_stages_and_resumed_ends_the_same(uninterrupted, tmp_path):
    folder = begin(tmp_path / "run")
    assert not Run(RUN, folder, should_stop=stop_after(3)).execute()
    assert [line["env_steps"] for line in metrics(folder)] == [CHUNK, 2 * CHUNK, 3 * CHUNK]
    assert not Run(RUN, folder, should_stop=stop_after(4)).execute()
    assert metrics(folder)[-1]["stage"] == "self-play"
    assert Run(RUN, folder).execute()
    assert_same_end(folder, uninterrupted)


@pytest.mark.slow
def test_opponents_from_the_past_are_resumed_with_the_rest(tmp_path):
    past = OpponentConfig(scheme="prioritised-hard", versions=4, seats=2, renewal=CHUNK)
    config = replace(RUN, stages="self-play", self_play=replace(RUN.self_play, opponents=past))
    whole, broken = begin(tmp_path / "whole", config), begin(tmp_path / "broken", config)
    assert Run(config, whole).execute()
    assert not Run(config, broken, should_stop=stop_after(2)).execute()
    assert Run(config, broken).execute()
    assert_same_end(broken, whole)
    assert load_config(whole / "config.toml") == config


def test_a_finished_run_resumed_has_nothing_left_to_do(uninterrupted):
    before = agents(uninterrupted), metrics(uninterrupted)
    reports = []
    assert Run(RUN, uninterrupted, reports.append).execute()
    assert reports == []
    assert (agents(uninterrupted), metrics(uninterrupted)) == before


class Killed(BaseException):
    """Stands for SIGKILL: nothing in the program may catch it."""


def kill_at(moment, count, monkeypatch):
    """Kill when it happens for the `count`-th time that a chunk is reported, or that a file is put in place."""
    seen = iter(range(1, 1000))
    replace_file = os.replace

    def happens(what):
        if what == moment and next(seen) == count:
            raise Killed

    def replace_or_die(source, target):
        happens(Path(target).name)
        replace_file(source, target)

    monkeypatch.setattr(os, "replace", replace_or_die)
    return lambda progress: happens("chunk")


@pytest.mark.parametrize(
    ("moment", "count"),
    [
        pytest.param("checkpoint.safetensors", 1, id="before the first checkpoint"),
        pytest.param("chunk", 3, id="between metrics and checkpoint"),
        pytest.param("checkpoint.safetensors", 3, id="while a checkpoint is written"),
        pytest.param("P_stage1.safetensors", 1, id="at the end of stage 1"),
        pytest.param("checkpoint.safetensors", 5, id="before the first checkpoint of stage 2"),
        pytest.param("E_curriculum-50.safetensors", 1, id="between two agents"),
        pytest.param("chunk", 8, id="after the last chunk"),
    ],
)
@pytest.mark.usefixtures("checkpoint_after_every_chunk")
def test_a_run_killed_and_resumed_ends_the_same(uninterrupted, tmp_path, monkeypatch, moment, count):
    folder = begin(tmp_path / "run")
    with pytest.raises(Killed), monkeypatch.context() as patch:
        Run(RUN, folder, report=kill_at(moment, count, patch)).execute()
    assert Run(RUN, folder).execute()
    assert_same_end(folder, uninterrupted)
    assert not list(folder.rglob("*.tmp"))


CHILD = """
import os, signal, sys
from pathlib import Path
from apollonius.io.cache import keep_compilations
from apollonius.learn import run
from tests.learn.tiny import RUN

keep_compilations()

def die_in_self_play(progress):
    if progress.stage == "self-play" and progress.env_steps == 3 * 8192:
        os.kill(os.getpid(), signal.SIGKILL)

run.CHECKPOINT_SECONDS = 0.0
run.Run(RUN, Path(sys.argv[1]), die_in_self_play).execute()
"""


def test_a_process_killed_by_the_system_leaves_a_run_that_ends_the_same(uninterrupted, tmp_path):
    folder = begin(tmp_path / "run")
    child = subprocess.run([sys.executable, "-c", CHILD, str(folder)], cwd=REPOSITORY, check=False)
    assert child.returncode == -signal.SIGKILL
    assert len(metrics(folder)) == 7
    assert Run(RUN, folder).execute()
    assert_same_end(folder, uninterrupted)


def test_two_processes_never_train_in_one_folder(tmp_path):
    folder = begin(tmp_path / "run")
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, folder], cwd=REPOSITORY, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout.readline() == "holds\n"
        before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        for begins in (Run(RUN, folder).execute, lambda: create_run(RUN, folder, force=True)):
            with pytest.raises(InvalidInput, match=f"is being trained by process {child.pid}: wait for it"):
                begins()
        assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
        child.kill()  # which lets go of the folder
    (folder / "half.tmp").touch()
    with held(folder):
        assert not (folder / "half.tmp").exists()
    assert not (folder / ".process").exists()


HOLD = """
import sys
from pathlib import Path
from apollonius.learn.folder import held

with held(Path(sys.argv[1])):
    print("holds", flush=True)
    sys.stdin.read()
"""


@pytest.mark.usefixtures("checkpoint_after_every_chunk")
def test_a_full_disk_spares_the_last_checkpoint(uninterrupted, tmp_path, monkeypatch):
    folder = begin(tmp_path / "run")
    assert not Run(RUN, folder, should_stop=stop_after(2)).execute()
    checkpoint = (folder / "checkpoint.safetensors").read_bytes()

    def fail(number):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fail)
        with pytest.raises(OSError, match="No space left"):
            Run(RUN, folder).execute()
    assert (folder / "checkpoint.safetensors").read_bytes() == checkpoint
    assert Run(RUN, folder).execute()
    assert_same_end(folder, uninterrupted)


@pytest.fixture
def self_play_starts(monkeypatch):
    """The pursuer's and the evader's network with which each self-play began."""
    networks = []
    start = curriculum.start

    def recorded(plan, game, key, fixed, first):
        if not fixed:
            networks.append(jax.tree.map(jnp.copy, tuple(first)))
        return start(plan, game, key, fixed, first)

    monkeypatch.setattr(curriculum, "start", recorded)
    return networks


def test_self_play_goes_on_from_the_best_pursuer_of_stage_1(self_play_starts, tmp_path, monkeypatch):
    """Of its four evaluations, the third is the first of the best."""
    captures = iter([3, 4, 9, 9, 0])
    evaluated = []

    def scripted_evaluation(game, players, starts, key):
        evaluated.append(jax.tree.map(lambda leaf: leaf[0], players.pursuer.members.network))
        captured = jnp.arange(64) < next(captures)
        return Results(jnp.where(captured, Outcome.CAPTURED, Outcome.NO_RESULT), jnp.ones(64, jnp.int32))

    monkeypatch.setattr(run_module, "play_out", scripted_evaluation)
    folder = begin(tmp_path / "run")
    assert not Run(RUN, folder, should_stop=stop_after(5)).execute()

    best = load_agent(folder / "agents" / "P_stage1.safetensors")
    assert best.header.training["env_steps"] == 3 * CHUNK
    assert best.header.training["outcomes"]["captured"] == 9
    assert eqx.tree_equal(best.network, evaluated[2])
    assert not eqx.tree_equal(best.network, evaluated[3])
    assert eqx.tree_equal(self_play_starts, [(best.network, None)])


@pytest.mark.slow
def test_stage_1_against_a_moving_evader_keeps_the_last_pursuer(tmp_path, monkeypatch):
    """A random evader mostly loses by itself, so the one with most wins may be one that waits."""
    wins = iter([(1, 5), (2, 9), (8, 2), (3, 0)])
    seen = []

    def scripted_evaluation(game, players, starts, key):
        seen.append(type(players.evader.members).__name__)
        captured, failed = next(wins)
        games = jnp.arange(64)
        outcome = jnp.where(games < captured + failed, Outcome.EVADER_OUT_OF_RANGE, Outcome.NO_RESULT)
        return Results(jnp.where(games < captured, Outcome.CAPTURED, outcome), jnp.ones(64, jnp.int32))

    monkeypatch.setattr(run_module, "play_out", scripted_evaluation)
    config = replace(RUN, stages="fixed-target", evaders=("random",))
    folder = begin(tmp_path / "run", config)
    assert Run(config, folder).execute()
    assert seen == ["Uniform"] * 4
    assert list(agents(folder)) == ["P_random"]
    training = load_agent(folder / "agents" / "P_random.safetensors").header.training
    assert (training["env_steps"], training["outcomes"]["captured"]) == (4 * CHUNK, 3)


def test_a_moving_evader_gives_another_training_than_one_that_stays(uninterrupted, tmp_path):
    config = replace(RUN, stages="fixed-target", evaders=("random",))
    folder = begin(tmp_path / "run", config)
    assert not Run(config, folder, should_stop=stop_after(1)).execute()
    (first,) = metrics(folder)
    assert first["outcomes"] != metrics(uninterrupted)[0]["outcomes"]


@pytest.mark.slow
def test_a_given_pursuer_goes_on_against_several_evaders(uninterrupted, tmp_path):
    """No update in the first chunk, so what plays in it is what was given."""
    mine = uninterrupted / "agents"
    evaders = (str(mine / "E_curriculum.safetensors"), "random", str(mine / "E_curriculum-25.safetensors"))
    config = replace(RUN, stages="fixed-target", evaders=evaders, pursuer=str(mine / "P_stage1.safetensors"))
    config = replace(config, dqn=replace(config.dqn, learning_starts=5 * CHUNK))
    folder = begin(tmp_path / "run", config)
    assert Run(config, folder).execute()
    assert list(agents(folder)) == ["P_pool"]
    given, kept = (load_agent(path).network for path in (Path(config.pursuer), folder / "agents/P_pool.safetensors"))
    assert eqx.tree_equal(given, kept)


def test_the_price_of_a_failure_is_the_stages_own(tmp_path):
    """Some pursuers fail in the first chunk, where nothing has been learned yet: only the price differs."""
    returns = []
    for failure in (10.0, 30.0):
        config = replace(RUN, stages="fixed-target", fixed_target=replace(RUN.fixed_target, failure=failure))
        folder = begin(tmp_path / str(failure), config)
        assert not Run(config, folder, should_stop=stop_after(1)).execute()
        (first,) = metrics(folder)
        returns.append(first["pursuer_return"])
    games = sum(first["outcomes"].values())
    failed = sum(first["outcomes"][name] for name in ("pursuer_hit_obstacle", "pursuer_out_of_range", "both_failed"))
    assert failed > 0
    assert returns[0] - returns[1] == pytest.approx(20.0 * failed / games, abs=1e-3)


def test_self_play_from_a_given_pursuer_is_the_second_half_of_the_curriculum(uninterrupted, tmp_path):
    config = replace(RUN, stages="self-play", pursuer=str(uninterrupted / "agents" / "P_stage1.safetensors"))
    folder = begin(tmp_path / "run", config)
    assert Run(config, folder).execute()
    assert metrics(folder) == metrics(uninterrupted)[4:]
    assert sorted(agents(folder)) == CURRICULUM
    for name in CURRICULUM:
        mine, theirs = (load_agent(path / "agents" / f"{name}.safetensors") for path in (folder, uninterrupted))
        assert eqx.tree_equal(mine.network, theirs.network)


def test_self_play_goes_on_from_given_agents_and_resumes_without_their_files(uninterrupted, self_play_starts, tmp_path):
    first = tmp_path / "P.safetensors", tmp_path / "E.safetensors"
    for path, name in zip(first, ("P_stage1", "E_curriculum"), strict=True):
        path.write_bytes(agents(uninterrupted)[name])
    networks = tuple(load_agent(path).network for path in first)
    config = replace(RUN, stages="self-play", pursuer=str(first[0]), evader=str(first[1]))
    whole, folder = begin(tmp_path / "whole", config), begin(tmp_path / "run", config)
    assert Run(config, whole).execute()
    assert eqx.tree_equal(self_play_starts, [networks])
    assert metrics(whole) != metrics(uninterrupted)[4:]
    assert not Run(config, folder, should_stop=stop_after(2)).execute()
    for path in first:
        path.unlink()
    assert Run(config, folder).execute()
    assert metrics(folder) == metrics(whole)


@pytest.mark.parametrize(
    ("network", "named"),
    [(("encoded", 16, 1), "'paper'.*'encoded'"), (("paper", 8, 1), "16.*8"), (("paper", 16, 2), "1.*2")],
    ids=["observation", "width", "depth"],
)
def test_a_first_pursuer_of_another_kind_than_the_config_trains_is_refused(tmp_path, network, named):
    path = tmp_path / "P.safetensors"
    save_agent(describe(make_network(*network, jax.random.key(0)), Role.PURSUER, {}, {}), path)
    with pytest.raises(InvalidInput, match=f"{path}.*{named}"):
        curriculum.load_first(replace(RUN, stages="self-play", pursuer=str(path)), Role.PURSUER)


def test_self_play_can_start_from_scratch(uninterrupted, self_play_starts, tmp_path):
    config = replace(RUN, stages="self-play")
    folder = begin(tmp_path / "run", config)
    assert Run(config, folder).execute()
    assert self_play_starts == [(None, None)]
    assert sorted(agents(folder)) == [name.replace("curriculum", "scratch") for name in CURRICULUM]
    assert metrics(folder) != metrics(uninterrupted)[4:]


def test_each_stage_weighs_progress_in_its_own_way(tmp_path, monkeypatch):
    weights = []
    play_and_learn = curriculum.play_and_learn

    def recorded(plan, game, *rest):
        weights.append(game.reward.progress)
        return play_and_learn(plan, game, *rest)

    monkeypatch.setattr(curriculum, "play_and_learn", recorded)
    Run(RUN, begin(tmp_path / "run"), should_stop=stop_after(5)).execute()
    assert weights == [3.0, 3.0, 3.0, 3.0, 1.0]


def test_another_seed_trains_another_agent_and_stage_1_can_stand_alone(uninterrupted, tmp_path):
    config = replace(RUN, stages="fixed-target", seed=1)
    folder = begin(tmp_path / "run", config)
    assert Run(config, folder).execute()
    assert list(agents(folder)) == ["P_stage1"]
    mine, theirs = (load_agent(path / "agents" / "P_stage1.safetensors").network for path in (folder, uninterrupted))
    assert not np.any(mine.layers[0].weight == theirs.layers[0].weight)


@pytest.mark.parametrize("kept", [0, 7, 1000, -1])
def test_a_truncated_checkpoint_is_refused(uninterrupted, tmp_path, kept):
    folder = begin(tmp_path / "run")
    content = (uninterrupted / "checkpoint.safetensors").read_bytes()
    (folder / "checkpoint.safetensors").write_bytes(content[:kept])
    with pytest.raises(InvalidInput, match=r"not a whole checkpoint.*train again"):
        Run(RUN, folder).execute()


@pytest.mark.parametrize("lie", [lambda end, line: end - 40, lambda end, line: end - line, lambda end, line: end + 1])
def test_a_checkpoint_that_lies_about_the_metrics_is_refused_and_cuts_nothing(uninterrupted, tmp_path, lie):
    folder = begin(tmp_path / "run")
    content, stand = ((uninterrupted / "checkpoint.safetensors").read_bytes(), load_stand(uninterrupted / CHECKPOINT))
    whole = (uninterrupted / "metrics.jsonl").read_bytes()
    lying = replace(stand, metrics_bytes=lie(len(whole), len(whole.splitlines(keepends=True)[-1])))
    (folder / CHECKPOINT).write_bytes(save(load(content), {FORMAT: json.dumps(asdict(lying))}))
    (folder / "metrics.jsonl").write_bytes(whole)
    with pytest.raises(InvalidInput, match=r"metrics.jsonl.*checkpoint says; train again|no record of training"):
        Run(RUN, folder).execute()
    assert (folder / "metrics.jsonl").read_bytes() == whole


def test_an_agent_is_no_checkpoint(uninterrupted, tmp_path):
    folder = begin(tmp_path / "run")
    (folder / "checkpoint.safetensors").write_bytes(agents(uninterrupted)["P_curriculum"])
    with pytest.raises(InvalidInput, match=r"no checkpoint of this version.*train again"):
        Run(RUN, folder).execute()


@pytest.mark.parametrize(
    "changed",
    [
        replace(RUN, dqn=replace(DQN, depth=2)),
        replace(RUN, dqn=replace(DQN, width=32)),
        replace(RUN, dqn=replace(DQN, replay_capacity=2 * CHUNK)),
        replace(RUN, stages="fixed-target"),
    ],
    ids=["depth", "width", "replay_capacity", "stages"],
)
def test_a_checkpoint_of_another_config_is_refused(uninterrupted, tmp_path, changed):
    folder = begin(tmp_path / "run", changed)
    (folder / "checkpoint.safetensors").write_bytes((uninterrupted / "checkpoint.safetensors").read_bytes())
    with pytest.raises(InvalidInput, match="train again"):
        Run(changed, folder).execute()
