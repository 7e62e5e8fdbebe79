"""Trackers have the records of metrics.jsonl: TensorBoard files are read back, stand-ins keep what they are sent."""

import os
import shutil
import sys
from unittest.mock import MagicMock

import pytest

from apollonius.cli.main import main
from apollonius.learn.folder import load_config
from apollonius.learn.metrics import load_metrics


@pytest.fixture
def run(demo, tmp_path):
    return shutil.copytree(demo, tmp_path / "demo")


def check(found, run):
    """The numbers that a tracker has are those of the metrics, at the env steps of both stages."""
    lines = load_metrics(run / "metrics.jsonl")
    first, last = lines[0], lines[-1]
    before = max(line.env_steps for line in lines if line.stage == first.stage)
    assert found[f"{first.stage}/pursuer_return", first.env_steps] == pytest.approx(first.pursuer_return)
    step = before + last.env_steps
    assert found["self-play/loss/evader", step] == pytest.approx(last.losses["evader"])
    assert found["self-play/updates", step] == last.updates
    greedy = last.evaluation.outcomes["captured"] / sum(last.evaluation.outcomes.values())
    assert found["self-play/greedy/captured", step] == pytest.approx(greedy, rel=1e-6)
    returns = [key for key in found if key[0].endswith("pursuer_return")]
    assert len(returns) == len(lines)


def test_tensorboard_files_have_every_record(run):
    pytest.importorskip("tensorboardX", reason="needs tensorboardX: pip install tensorboardX")
    reading = "tensorboard.backend.event_processing.event_accumulator"
    accumulator = pytest.importorskip(reading, reason="needs tensorboard: pip install tensorboard")
    for _ in range(2):  # the second in place of the first
        assert main(["track", str(run), "--to", "tensorboard"]) == 0
    events = accumulator.EventAccumulator(str(run / "tensorboard"), size_guidance={"scalars": 0})
    events.Reload()
    found = {(tag, event.step): event.value for tag in events.Tags()["scalars"] for event in events.Scalars(tag)}
    assert len(found) == sum(len(events.Scalars(tag)) for tag in events.Tags()["scalars"])
    check(found, run)


def stand_in(name, monkeypatch):
    """A module of this name that records what is called."""
    module = MagicMock()
    monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr("apollonius.io.errors.find_spec", lambda module: module)
    return module


@pytest.mark.parametrize("name", ["wandb", "mlflow", "trackio"])
def test_other_trackers_receive_every_record_and_are_closed(run, monkeypatch, name):
    module = stand_in(name, monkeypatch)
    monkeypatch.setenv("WANDB_DIR", "")  # so that what follows is undone
    monkeypatch.delenv("WANDB_DIR")
    assert main(["track", str(run), "--to", name]) == 0
    called = [(path.rsplit(".", 1)[-1], given, options) for path, given, options in module.mock_calls]
    logged = [given for what, given, _ in called if what in ("log", "log_metrics")]
    check({(key, step): value for values, step in logged for key, value in values.items()}, run)
    assert os.environ.get("WANDB_DIR") == (None if name == "mlflow" else str(run.resolve()))
    assert called[-1][0] in ("finish", "end_run")
    told = [one for _, given, options in called for one in (*given, *options.values())]
    assert run.name in told
    seed = load_config(run / "config.toml").seed
    assert [one["seed"] for one in told if isinstance(one, dict) and "seed" in one] == [seed]


def test_tracker_refusal_is_reported_in_one_line(run, monkeypatch, capsys):
    def refuse(**options):
        raise RuntimeError("no key")

    stand_in("wandb", monkeypatch)
    monkeypatch.setattr(sys.modules["wandb"], "init", refuse)
    assert main(["track", str(run), "--to", "wandb"]) == 2
    assert capsys.readouterr().err == "apollonius track: wandb refuses the run (no key): see its own settings.\n"
