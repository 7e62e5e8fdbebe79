"""Trainings side by side: what one alone writes, up to rounding, also after a stop, and what is refused."""

import json
from argparse import Namespace
from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import load_file

from apollonius.cli.runs import run_reproduce
from apollonius.io.errors import InvalidInput
from apollonius.learn import run as run_module
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import create_run, load_checkpoint_meta
from apollonius.learn.metrics import load_metrics
from apollonius.learn.ppo import PPOConfig
from apollonius.learn.progress import load_status
from apollonius.learn.response import ResponseConfig
from apollonius.learn.run import TrainingRun
from apollonius.reproduce import side_by_side
from apollonius.reproduce.side_by_side import require_side_by_side, train_side_by_side
from tests.learn.test_ppo_self_play import PPO
from tests.learn.tiny import CHUNK, DQN, GAME, RUN, SELF_PLAY, STAGE

SEEDS = (0, 1)
SHORT = RunConfig(
    game=GAME,
    algorithm=replace(DQN, learning_starts=CHUNK // 2),
    stages=(
        replace(STAGE, env_steps=2 * CHUNK, evaluations=2),
        replace(SELF_PLAY, env_steps=2 * CHUNK, evaluations=1, snapshots=1),
    ),
)
"""Two chunks of either stage; learning begins in the first."""
AGENTS = ["E_curriculum", "P_curriculum", "P_stage1"]


def folders_of(folder):
    """New runs of both seeds."""
    folders = [folder / f"seed-{seed}" for seed in SEEDS]
    for seed, run in zip(SEEDS, folders, strict=True):
        create_run(replace(SHORT, seed=seed), run)
    return folders


def agents_of(run):
    """The weights of a run's agents, by name."""
    return {path.stem: load_file(path) for path in sorted((run / "agents").glob("*.safetensors"))}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Runs of both seeds, trained side by side."""
    folders = folders_of(tmp_path_factory.mktemp("side_by_side"))
    train_side_by_side(folders)
    return folders


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The run of the second seed, trained by itself."""
    folder = folders_of(tmp_path_factory.mktemp("alone"))[1]
    assert TrainingRun(replace(SHORT, seed=1), folder).execute()
    return folder


@pytest.mark.slow
def test_runs_have_the_agents_and_metrics_of_one_alone_up_to_rounding(runs, alone):
    """Weights of up to 1 in size differ by less than 1e-4 after four chunks, those of other seeds by far more."""
    ours, other, expected = agents_of(runs[1]), agents_of(runs[0]), agents_of(alone)
    assert list(ours) == list(expected) == AGENTS
    for name, weights in expected.items():
        for layer, values in weights.items():
            np.testing.assert_allclose(ours[name][layer], values, rtol=0, atol=1e-4)
        assert any(np.abs(other[name][layer] - values).max() > 0.05 for layer, values in weights.items())
    lines, alone_lines = (load_metrics(run / "metrics.jsonl") for run in (runs[1], alone))
    assert [line.stage for line in lines] == [line.stage for line in alone_lines]
    for line, expected_line in zip(lines, alone_lines, strict=True):
        assert line.env_steps == expected_line.env_steps
        assert line.updates == expected_line.updates
        assert (line.evaluation is None) == (expected_line.evaluation is None)


@pytest.mark.slow
def test_runs_have_ended_like_any(runs):
    for run in runs:
        assert load_status(run / "state.json").state == "finished"
        assert load_checkpoint_meta(run / "checkpoint.safetensors").ended
    before = {path: path.read_bytes() for run in runs for path in run.rglob("*.safetensors")}
    train_side_by_side(runs)
    assert {path: path.read_bytes() for run in runs for path in run.rglob("*.safetensors")} == before


@pytest.mark.slow
@pytest.mark.parametrize("chunks", [1, 2])
def test_stopped_runs_go_on_to_the_same_bits(runs, tmp_path, monkeypatch, chunks):
    """Within the first stage and, where its end is reached, within the second."""
    folders = folders_of(tmp_path)
    looks = iter([False] * (chunks - 1) + [True] * 2)
    with monkeypatch.context() as patch:
        patch.setattr(side_by_side, "should_stop", lambda: next(looks))
        with pytest.raises(KeyboardInterrupt):
            train_side_by_side(folders)
    assert {load_status(run / "state.json").state for run in folders} == {"stopped"}
    train_side_by_side(folders)
    for run, whole in zip(folders, runs, strict=True):
        for name, weights in agents_of(whole).items():
            for layer, values in weights.items():
                np.testing.assert_array_equal(agents_of(run)[name][layer], values)


@pytest.mark.slow
def test_runs_go_on_side_by_side_where_one_alone_was_stopped(runs, tmp_path):
    """The first seed stopped after a chunk, the second not begun: the two are not equally far."""
    folders = folders_of(tmp_path)
    assert not TrainingRun(replace(SHORT, seed=0), folders[0], should_stop=lambda: True).execute()
    train_side_by_side(folders)
    for run in folders:
        assert list(agents_of(run)) == AGENTS
        assert len(load_metrics(run / "metrics.jsonl")) == 4


@pytest.mark.slow
def test_diverged_run_is_named(tmp_path, monkeypatch):
    folders = folders_of(tmp_path)

    def refuse(*args):
        raise InvalidInput("the training has diverged")

    monkeypatch.setattr(run_module, "metrics_line", refuse)
    with pytest.raises(InvalidInput, match=r"seed-0': the training has diverged"):
        train_side_by_side(folders)
    assert json.loads((folders[1] / "state.json").read_text())["state"] == "failed"


def test_policies_learn_side_by_side(tmp_path):
    """They keep no replay buffer."""
    folders = [tmp_path / f"seed-{seed}" for seed in SEEDS]
    for seed, folder in zip(SEEDS, folders, strict=True):
        create_run(replace(RUN, algorithm=PPO, stages=(SELF_PLAY,), seed=seed), folder)
    train_side_by_side(folders)
    first, second = map(agents_of, folders)
    assert list(first) == list(second)
    for name, weights in first.items():
        assert any(np.abs(second[name][layer] - values).max() > 0.05 for layer, values in weights.items())


def test_trainings_that_cannot_be_side_by_side_are_refused():
    response = RunConfig(algorithm=PPOConfig(), stages=(ResponseConfig(),))
    with pytest.raises(InvalidInput, match="stage side by side = response"):
        require_side_by_side(response, 2)
    versions = replace(SHORT, stages=(replace(SELF_PLAY, opponents="uniform"),))
    with pytest.raises(InvalidInput, match="latest"):
        require_side_by_side(versions, 2)
    with pytest.raises(InvalidInput, match="seeds x transitions kept"):
        require_side_by_side(SHORT, 10**9)


def test_workers_are_refused_side_by_side(tmp_path):
    options = Namespace(side_by_side=True, on="slurm", budget="quick", seeds=2, out=tmp_path / "study", resume=False)
    with pytest.raises(InvalidInput, match="--on = slurm"):
        run_reproduce(options)
    assert not (tmp_path / "study").exists()
