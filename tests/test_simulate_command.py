"""`apollonius simulate`."""

import json

import pytest

from apollonius.cli import main


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
    assert "by the rules   with bodies" in said
    assert "no result" in said
    (replay,) = (tmp_path / "replays").iterdir()
    assert main(["show", str(replay), "--out", "game.gif"]) == 0


def test_the_gap_part_by_part_of_a_drive_of_ones_own(short, capsys, tmp_path):
    (tmp_path / "drive.toml").write_text("turn_acceleration = 0.5\n")
    assert main([*short, "--drive", "drive.toml", "--ablate", "--json"]) == 0
    drives = json.loads(capsys.readouterr().out)["drives"]
    assert next(iter(drives)) == "as it is"
    assert list(drives)[-1] == "without all of these"
    turning = {kind: drive["tracking"]["evader"]["heading"]["rms"] for kind, drive in drives.items()}
    assert turning["without turn acceleration"] < turning["as it is"] / 1.2


@pytest.mark.parametrize(
    ("text", "complaint"), [("mas = 3.0\n", "did you mean 'mass'"), ("mass = -1.0\n", "mass = -1.0"), ("=", "no TOML")]
)
def test_bad_drives_are_refused(short, capsys, tmp_path, text, complaint):
    (tmp_path / "drive.toml").write_text(text)
    assert main([*short, "--drive", "drive.toml"]) == 2
    assert complaint in capsys.readouterr().err
