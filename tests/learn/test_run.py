"""A training run in its folder: its files, and that stopping it in any way changes nothing."""

import fcntl
import json
import os
import platform
import shutil
import stat
from dataclasses import asdict, replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import load, save

from apollonius.agents.network import make_actor, make_network
from apollonius.agents.store import describe, load_agent, save_agent
from apollonius.game.types import BySide, Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.learn import run as run_module
from apollonius.learn import stage as stage_module
from apollonius.learn.folder import FORMAT, create_run, load_checkpoint_meta, load_config, lock_run
from apollonius.learn.progress import ProcessStatus, progress_of, runs_below
from apollonius.learn.rollout_stage import RolloutStage
from apollonius.learn.run import TrainingRun, load_first_network
from apollonius.learn.self_play import SelfPlay
from apollonius.learn.stage import Metrics
from tests.acting import results_of
from tests.learn.tiny import CHUNK, DQN, RUN, SELF_PLAY, STAGE

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
    """The folder of a run of both stages, four chunks each, that nothing interrupted."""
    folder = begin(tmp_path_factory.mktemp("run") / "uninterrupted")
    assert TrainingRun(RUN, folder).execute()
    return folder


def assert_same_end(folder, uninterrupted):
    assert agents(folder) == agents(uninterrupted)
    assert metrics(folder) == metrics(uninterrupted)


def test_run_leaves_its_config_metrics_checkpoint_and_agents(uninterrupted):
    files = {"agents", CHECKPOINT, "config.toml", "metrics.jsonl", "state.json"}
    assert {path.name for path in uninterrupted.iterdir()} == files
    assert sorted(agents(uninterrupted)) == [*CURRICULUM, "P_stage1"]
    assert load_config(uninterrupted / "config.toml") == RUN
    assert (uninterrupted / CHECKPOINT).stat().st_size < 1_000, "without what only a resumed run needs"


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
        assert {sum(line["evaluation"]["outcomes"].values()) for line in stage} == {SELF_PLAY.evaluation_games}
    assert set(lines[0]["losses"]) == {"pursuer"}
    assert set(lines[4]["losses"]) == {"pursuer", "evader"}
    file = uninterrupted / "metrics.jsonl"
    seconds = [json.loads(line)["seconds"] for line in file.read_text().splitlines()]
    assert seconds[3] > seconds[0] > 0
    took = file.stat().st_mtime - (uninterrupted / "config.toml").stat().st_mtime
    assert seconds[3] + seconds[7] < took + 0.1, "each stage's own"


@pytest.mark.slow
def test_resumed_run_restores_past_opponents(tmp_path):
    past = replace(SELF_PLAY, opponents="prioritised-hard", versions=4, renewal=CHUNK)
    config = replace(RUN, stages=(past,))
    whole, broken = begin(tmp_path / "whole", config), begin(tmp_path / "broken", config)
    assert TrainingRun(config, whole).execute()
    assert not TrainingRun(config, broken, should_stop=stop_after(2)).execute()
    assert TrainingRun(config, broken).execute()
    assert_same_end(broken, whole)
    assert load_config(whole / "config.toml") == config


def test_resuming_a_finished_run_changes_nothing(uninterrupted):
    before = agents(uninterrupted), metrics(uninterrupted)
    reports = []
    assert TrainingRun(RUN, uninterrupted, lambda *report: reports.append(report)).execute()
    assert reports == []
    assert (agents(uninterrupted), metrics(uninterrupted)) == before
    assert (progress_of(uninterrupted).state.state, progress_of(uninterrupted).share) == ("finished", 1.0)


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
    return lambda line, share: happens("chunk")


def test_repeatedly_killed_run_ends_the_same(uninterrupted, tmp_path, monkeypatch):
    """Between metrics and checkpoint, before the first checkpoint of stage 2, and between two agents."""
    monkeypatch.setattr(run_module, "CHECKPOINT_SECONDS", 0.0)
    folder = begin(tmp_path / "run")
    for moment, count in (("chunk", 3), (CHECKPOINT, 3), ("E_curriculum-50.safetensors", 1)):
        with pytest.raises(Killed), monkeypatch.context() as patch:
            TrainingRun(RUN, folder, report=kill_at(moment, count, patch)).execute()
    assert TrainingRun(RUN, folder).execute()
    assert_same_end(folder, uninterrupted)
    assert not list(folder.rglob("*.tmp"))


def test_second_process_in_the_same_folder_is_refused(tmp_path):
    """A lock of one process holds against a second one of its own, too."""
    folder = begin(tmp_path / "run")
    (folder / "half.tmp").touch()
    with lock_run(folder):
        assert not (folder / "half.tmp").exists()
        before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        for begins in (TrainingRun(RUN, folder).execute, lambda: create_run(RUN, folder, force=True)):
            with pytest.raises(InvalidInput, match="is being trained by another process: wait for it"):
                begins()
        assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_run_lock_holds_on_nfs(tmp_path, monkeypatch):
    """There a lock of what is not open for writing is an error, and one of a folder is this machine's alone."""
    folder, locks = begin(tmp_path / "run"), []

    def flock(file, operation):
        number = file if isinstance(file, int) else file.fileno()
        assert stat.S_ISREG(os.fstat(number).st_mode)
        assert fcntl.fcntl(number, fcntl.F_GETFL) & os.O_ACCMODE != os.O_RDONLY
        if os.fstat(number).st_ino in locks:
            raise BlockingIOError
        locks.append(os.fstat(number).st_ino)

    monkeypatch.setattr(fcntl, "flock", flock)
    with lock_run(folder), pytest.raises(InvalidInput, match="is being trained"), lock_run(folder):
        pass


def test_symbolic_links_in_a_run_are_refused(tmp_path):
    folder, own = begin(tmp_path / "run"), tmp_path / "thesis.tex"
    own.write_text("mine")
    (folder / "metrics.jsonl").symlink_to(own)
    with pytest.raises(OSError, match="symbolic links"):
        TrainingRun(RUN, folder).execute()
    assert own.read_text() == "mine"


@pytest.fixture
def self_play_starts(monkeypatch):
    """The pursuer's and the evader's network with which each self-play began."""
    networks, init = [], SelfPlay.init

    def recorded(stage, key, first):
        networks.append(jax.tree.map(jnp.copy, tuple(first)))
        return init(stage, key, first)

    monkeypatch.setattr(SelfPlay, "init", recorded)
    return networks


@pytest.fixture
def script_evaluations(monkeypatch):
    """A function that lets evaluations come to so many captures each; it returns a list of who plays in them."""

    def script(*captures):
        evaluated = []

        def evaluate(game, players, starts, key):
            captured = jnp.arange(64) < captures[len(evaluated)]
            evaluated.append(jax.tree.map(jnp.copy, players))
            return results_of(jnp.where(captured, Outcome.CAPTURED, Outcome.NO_RESULT), jnp.ones(64, jnp.int32))

        monkeypatch.setattr(stage_module, "play_out", evaluate)
        return evaluated

    return script


def test_self_play_starts_from_the_best_pursuer_of_stage_1(self_play_starts, script_evaluations, tmp_path, monkeypatch):
    """Of its four evaluations, the third is the first of the best. Progress weighs less from then on."""
    evaluated, weights, play_and_learn = script_evaluations(3, 4, 9, 9, 0), [], RolloutStage.step

    def recorded(stage, state):
        weights.append(stage.game.reward.progress)
        return play_and_learn(stage, state)

    monkeypatch.setattr(RolloutStage, "step", recorded)
    folder = begin(tmp_path / "run")
    assert (progress_of(folder).state, progress_of(folder).share) == (ProcessStatus(), 0.0)
    assert not TrainingRun(RUN, folder, should_stop=stop_after(5)).execute()
    assert weights == [3.0, 3.0, 3.0, 3.0, 1.0]

    best = load_agent(folder / "agents" / "P_stage1.safetensors")
    assert best.header.training["env_steps"] == 3 * CHUNK
    assert best.header.training["outcomes"]["captured"] == 9
    third, fourth = (jax.tree.map(lambda leaf: leaf[0], one.pursuer.members.network) for one in evaluated[2:4])
    assert eqx.tree_equal(best.network, third)
    assert not eqx.tree_equal(best.network, fourth)
    assert eqx.tree_equal(self_play_starts, [(best.network, None)])

    found = progress_of(folder)
    assert (found.state.state, found.state.machine) == ("stopped", platform.node())
    assert found.line.stage == "self-play"
    assert found.share == pytest.approx(1 / 3), "self-play, which has not learned yet, has two learners"
    assert sum(found.evaluation.outcomes.values()) == SELF_PLAY.evaluation_games
    assert found.age < 600
    assert runs_below(tmp_path) == [folder]


def test_given_pursuer_trains_against_several_evaders(uninterrupted, script_evaluations, tmp_path, monkeypatch):
    """No update is made, so what is kept is what was given: of the last evaluation, not of that with most captures."""
    evaluated, seen, no_games = script_evaluations(3, 1), [], jnp.zeros(len(Outcome), jnp.int32)
    nothing = Metrics(no_games, *[BySide(jnp.zeros(()), jnp.zeros(()))] * 2, jnp.asarray(0))

    def step(stage, state):
        seen.append(stage.evaders.size)
        return state, nothing

    monkeypatch.setattr(RolloutStage, "step", step)
    mine = uninterrupted / "agents"
    evaders = (str(mine / "E_curriculum.safetensors"), str(mine / "E_curriculum-25.safetensors"))
    stage_1 = replace(STAGE, evaders=evaders, env_steps=2 * CHUNK, evaluations=2)
    config = replace(RUN, stages=(stage_1,), pursuer=str(mine / "P_stage1.safetensors"))
    folder = begin(tmp_path / "run", config)
    assert TrainingRun(config, folder).execute()
    assert list(agents(folder)) == ["P_pool"]
    given, kept = (load_agent(path) for path in (Path(config.pursuer), folder / "agents/P_pool.safetensors"))
    assert eqx.tree_equal(given.network, kept.network)
    assert kept.header.training["outcomes"]["captured"] == 1
    seen += [one.evader.size for one in evaluated]
    assert seen == [2, 2, 2, 2], "the same evaders in training and in both evaluations"


def test_self_play_starts_from_given_agents_and_resumes_without_files(uninterrupted, self_play_starts, tmp_path):
    first = tmp_path / "P.safetensors", tmp_path / "E.safetensors"
    for path, name in zip(first, ("P_stage1", "E_curriculum"), strict=True):
        path.write_bytes(agents(uninterrupted)[name])
    networks = tuple(load_agent(path).network for path in first)
    config = replace(RUN, stages=(SELF_PLAY,), pursuer=str(first[0]), evader=str(first[1]))
    folder = begin(tmp_path / "run", config)
    assert not TrainingRun(config, folder, should_stop=stop_after(2)).execute()
    assert eqx.tree_equal(self_play_starts, [networks])
    whole = shutil.copytree(folder, tmp_path / "whole")
    assert TrainingRun(config, whole).execute()
    assert metrics(whole) != metrics(uninterrupted)[4:]
    for path in first:
        path.unlink()
    assert TrainingRun(config, folder).execute()
    assert metrics(folder) == metrics(whole)


@pytest.mark.parametrize(
    ("make", "size"),
    [
        (make_network, ("encoded", 16, 1)), (make_network, ("paper", 8, 1)), (make_network, ("paper", 16, 2)),
        (make_actor, ("paper", 16, 1)),
    ],
)  # fmt: skip
def test_initial_pursuer_of_another_network_kind_is_refused(tmp_path, make, size):
    path = tmp_path / "P.safetensors"
    save_agent(describe(make(*size, jax.random.key(0)), Role.PURSUER, {}, {}), path)
    with pytest.raises(InvalidInput, match=f"{path}.*a QNetwork of 1 layers of 16 that reads 'paper', as this config"):
        load_first_network(replace(RUN, stages=(SELF_PLAY,), pursuer=str(path)), Role.PURSUER)


def test_self_play_can_start_from_scratch(uninterrupted, self_play_starts, tmp_path):
    config = replace(RUN, stages=(SELF_PLAY,))
    folder = begin(tmp_path / "run", config)
    assert not TrainingRun(config, folder, should_stop=stop_after(1)).execute()
    assert self_play_starts == [(None, None)]
    assert list(agents(folder)) == ["E_scratch-25", "P_scratch-25"]
    assert metrics(folder) != metrics(uninterrupted)[4:5]


def test_checkpoint_with_wrong_metrics_size_is_refused_without_truncation(uninterrupted, tmp_path):
    content, whole = ((uninterrupted / name).read_bytes() for name in (CHECKPOINT, "metrics.jsonl"))
    folder, line = begin(tmp_path / "run"), len(whole.splitlines(keepends=True)[-1])
    (folder / "metrics.jsonl").write_bytes(whole)
    for size in (len(whole) - 40, len(whole) - line, len(whole) + 1):
        lying = asdict(replace(load_checkpoint_meta(uninterrupted / CHECKPOINT), metrics_bytes=size))
        (folder / CHECKPOINT).write_bytes(save(load(content), {FORMAT: json.dumps(lying)}))
        with pytest.raises(InvalidInput, match=r"metrics.jsonl.*checkpoint says; train again|no record of training"):
            TrainingRun(RUN, folder).execute()
        assert (folder / "metrics.jsonl").read_bytes() == whole


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """The folder of a run that was stopped."""
    folder = begin(tmp_path_factory.mktemp("run") / "stopped")
    assert not TrainingRun(RUN, folder, should_stop=stop_after(5)).execute()
    return folder


@pytest.mark.parametrize("source", ["stopped", "uninterrupted"])
@pytest.mark.parametrize(
    "changed",
    [
        {"algorithm": replace(DQN, depth=2)},
        {"algorithm": replace(DQN, replay_capacity=2 * CHUNK)},
        {"stages": (STAGE,)},
    ],
)
def test_checkpoint_of_another_config_is_refused(source, tmp_path, changed, request):
    config = replace(RUN, **changed)
    shutil.copy(request.getfixturevalue(source) / CHECKPOINT, folder := begin(tmp_path / "run", config))
    with pytest.raises(InvalidInput, match="train again"):
        TrainingRun(config, folder).execute()
