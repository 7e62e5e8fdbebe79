"""What a training changed: from the run's own evaluations, and by matches of its snapshots with fixed opponents."""

import json
import shutil

import pytest

from apollonius.cli.terminal import learning_table
from apollonius.evaluate import learning
from apollonius.evaluate.match import Match, play_match
from apollonius.game.types import Role
from apollonius.learn.folder import load_config


@pytest.fixture
def run(demo, tmp_path, monkeypatch):
    """A run with a snapshot of its evader after half of self-play."""
    monkeypatch.setattr(learning, "GAMES", 30)
    folder = shutil.copytree(demo, tmp_path / "run")
    shutil.copy(folder / "agents/E_curriculum.safetensors", folder / "agents/E_curriculum-50.safetensors")
    return folder


def test_learning_curves_match_evaluations_and_fixed_opponent_matches(run):
    config = load_config(run / "config.toml")
    stage1, pursuer, evader = learning.learning_curves(run, config)
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    captured = [
        line["evaluation"]["outcomes"]["captured"] / 500
        for line in lines
        if line["stage"] == "fixed-target" and "evaluation" in line
    ]
    assert list(stage1.wins.values()) == captured
    assert [*stage1.wins][-1] == 100
    assert [*pursuer.wins] == [0, 100], "it begins with that of stage 1"
    assert [*evader.wins] == [50, 100]
    assert evader.wins[50] == evader.wins[100]
    first = Match.of_names(config.game, str(run / "agents/P_stage1.safetensors"), "flee-aware", 30, seed=2)
    assert pursuer.wins[0] == play_match(first).pursuer_win_rate
    last = Match.of_names(config.game, "pure-pursuit", str(run / "agents/E_curriculum.safetensors"), 30, seed=2)
    assert evader.wins[100] == play_match(last).evader_undefeated_rate


def test_learning_table_has_quarter_columns_and_dashes_for_missing_values():
    curves = [learning.Curve("stage 1", {12: 0.1, 25: 0.25, 100: 1.0}), learning.Curve("self-play", {0: 0.5})]
    title, first, second = learning_table(curves).splitlines()
    assert title.split()[-10::2] == ["0", "25", "50", "75", "100"]
    assert first.split()[2:] == ["-", "25.0%", "-", "-", "100.0%"]
    assert second.split()[1:] == ["50.0%", "-", "-", "-", "-"]


def test_snapshots_omit_stage_1_of_a_run_of_self_play_alone(run):
    (run / "agents/P_stage1.safetensors").unlink()
    config = load_config(run / "config.toml")
    assert [*learning.snapshots(run, config, Role.PURSUER)] == [100]
