"""`apollonius simulate`."""

import json

import pytest

from apollonius.cli.main import main


@pytest.fixture(autouse=True)
def _simulator():
    pytest.importorskip("mujoco")


@pytest.fixture
def short(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text("max_steps = 15\n")
    return ["simulate", "pure-pursuit", "flee", "--games", "3", "--game", "short.toml"]


def test_it_prints_both_matches_and_records_games(short, capsys, tmp_path):
    assert main([*short, "--record", "1"]) == 0
    said = capsys.readouterr().out
    assert "pure-pursuit (pursuer) against flee (evader), 3 games, starts: rest" in said
    assert "by the rules  with bodies" in said
    assert "no result" in said
    (replay,) = (tmp_path / "replays").iterdir()
    assert main(["show", str(replay), "--out", "game.gif"]) == 0


def test_a_drive_of_ones_own_turns_as_slowly_as_its_file_says(short, capsys, tmp_path):
    turned = {}
    for acceleration in (0.5, 5.0):
        (tmp_path / "drive.toml").write_text(f"turn_acceleration = {acceleration}\n")
        folder = tmp_path / str(acceleration)
        assert main([*short, "--drive", "drive.toml", "--record", "1", "--replays", str(folder)]) == 0
        (file,) = folder.iterdir()
        states = json.loads(file.read_text())["states"]
        turned[acceleration] = sum(abs(states[5][heading] - states[0][heading]) for heading in (3, 7))
    assert turned[0.5] < turned[5.0] / 1.2, turned


@pytest.mark.parametrize(
    ("text", "complaint"), [("mas = 3.0\n", "did you mean 'mass'"), ("mass = -1.0\n", "mass = -1.0"), ("=", "no TOML")]
)
def test_bad_drives_are_refused(short, capsys, tmp_path, text, complaint):
    (tmp_path / "drive.toml").write_text(text)
    assert main([*short, "--drive", "drive.toml"]) == 2
    assert complaint in capsys.readouterr().err
