"""Sweeps are all combinations of values; how far runs are is read from their folders."""

import os
import platform
from dataclasses import asdict

import pytest

from apollonius.arenas.record import to_dict
from apollonius.io.document import to_json
from apollonius.io.errors import InvalidInput
from apollonius.learn.config import sweep
from apollonius.learn.folder import create_run
from apollonius.learn.progress import STATE, State, keep_state, progress_of
from tests.learn.tiny import RUN

NOBODY = 2**22 + 1
"""Greater than any process's number."""


def test_a_sweep_has_every_combination_and_changes_nothing_else():
    found = sweep(RUN, {"dqn.batch": [16, 32], "game.pursuer.v_max": [1.2, 2], "seed": [0, 3]})
    assert len(found) == 8
    one = found["dqn.batch=32,game.pursuer.v_max=2,seed=3"]
    assert (one.dqn.batch, one.game.pursuer.v_max, one.seed) == (32, 2.0, 3)
    same, own = (to_dict(one) for one in (found["dqn.batch=16,game.pursuer.v_max=1.2,seed=0"], RUN))
    assert (same["dqn"], same["game"]["pursuer"], same["seed"]) == (own["dqn"], own["game"]["pursuer"], own["seed"])


@pytest.mark.parametrize(
    ("field", "values", "naming"),
    [
        ("dqn.batsh", [1], "did you mean 'batch'"),
        ("dnq.batch", [1], "did you mean 'dqn.batch'"),
        ("sac.gamma", [0.9], "did you mean 'dqn.gamma'"),
        ("learning_rate", [1e-3], "move it to"),
        ("dqn.batch", [0], "batch = 0"),
        ("seed", [1, 1], "different ones"),
        ("seed", range(1001), "at most 1,000"),
    ],
)
def test_a_sweep_of_what_cannot_be_is_refused(field, values, naming):
    with pytest.raises(InvalidInput, match=naming):
        sweep(RUN, {field: values})


def test_the_share_of_a_training_counts_both_learners_of_self_play():
    steps = RUN.fixed_target.env_steps
    assert RUN.share("fixed-target", steps) == pytest.approx(1 / 3)
    assert RUN.share("self-play", steps) == 1.0
    assert RUN.share("fixed-target", 0) == 0.0


def test_who_trains_is_on_file_and_how_that_ended(tmp_path, monkeypatch):
    create_run(RUN, tmp_path / "run")
    monkeypatch.setenv("SLURM_ARRAY_JOB_ID", "7")
    monkeypatch.setenv("SLURM_ARRAY_TASK_ID", "2")

    def fail():
        assert progress_of(tmp_path / "run").state == State("running", platform.node(), os.getpid(), "7_2")
        return 1 / 0

    with pytest.raises(ZeroDivisionError):
        keep_state(tmp_path / "run", fail)
    found = progress_of(tmp_path / "run").state
    assert (found.state, found.error) == ("failed", "division by zero")

    def interrupt():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        keep_state(tmp_path / "run", interrupt)
    assert progress_of(tmp_path / "run").state.state == "stopped"


@pytest.mark.parametrize(
    ("machine", "process", "state"),
    [(platform.node(), NOBODY, "stopped"), (platform.node(), 1, "running"), ("elsewhere", NOBODY, "running")],
)
def test_a_process_of_this_machine_that_is_gone_was_stopped(tmp_path, machine, process, state):
    create_run(RUN, tmp_path / "run")
    (tmp_path / "run" / STATE).write_text(to_json(asdict(State("running", machine, process))))
    assert progress_of(tmp_path / "run").state.state == state


def test_a_run_whose_files_cannot_be_read_has_failed(tmp_path):
    create_run(RUN, tmp_path / "run")
    (tmp_path / "run" / STATE).write_text("garbage")
    found = progress_of(tmp_path / "run").state
    assert found.state == "failed"
    assert "state" in found.error
