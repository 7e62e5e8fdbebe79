"""A study as a command: its options, how many jobs run at a time and what they share, and what it writes."""

import json
import os
from dataclasses import dataclass

import pytest

from apollonius.errors import exit_status
from apollonius.jobs import available_cores
from apollonius.reproduce.finding import Finding
from studies import driver, held_out


@dataclass(frozen=True, kw_only=True)
class Counting(driver.AbstractStudy):
    """Plays nothing, and says what it was asked."""

    name = "counting"
    what: str = driver.option(help="what is counted")
    wait_for: str | None = driver.option(None, help="nobody by default")
    games: int = driver.option(7)

    def finding(self):
        return Finding("Counted", f"{self.games} {self.what}", ("one.png",), data={"games": self.games})


def test_fields_are_options_and_what_was_found_is_written(tmp_path, capsys):
    assert driver.main(Counting, ["sheep", "--out", str(tmp_path / "new"), "--games", "9"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "9 sheep"
    assert (tmp_path / "new" / "counting.md").read_text() == "## Counted\n\n9 sheep\n\n![Counted](one.png)\n"
    assert json.loads((tmp_path / "new" / "counting.json").read_text()) == {"games": 9}


def test_nothing_is_played_after_training_alone(tmp_path, capsys):
    assert driver.main(Counting, ["sheep", "--out", str(tmp_path / "new"), "--only", "train"]) == 0
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(("asked", "used"), [([], available_cores()), (["--processes", "1"], available_cores()[:1])])
def test_jobs_run_on_as_many_cores_as_are_asked_for(tmp_path, monkeypatch, asked, used):
    given = []
    monkeypatch.setattr(driver, "train_runs", lambda runs, cores, *rest: given.append(cores))
    assert driver.main(Counting, ["sheep", "--out", str(tmp_path), *asked]) == driver.STOPPED
    assert given == [used]


def test_compilations_are_kept_where_those_of_commands_are(tmp_path, monkeypatch):
    kept = []
    monkeypatch.setattr(driver, "keep_compilations", lambda: kept.append(dict(os.environ)))
    driver.main(Counting, ["sheep", "--out", str(tmp_path)])
    assert kept == [dict(os.environ)]
    assert "JAX_COMPILATION_CACHE_DIR" not in os.environ


@pytest.mark.parametrize("counted", ["--games", "--processes"])
def test_a_study_of_none_is_refused_in_one_line(counted, tmp_path, capsys):
    assert exit_status(lambda: held_out.main([counted, "0", "--out", str(tmp_path / "out")])) == 2
    assert capsys.readouterr().err == f"{counted} = 0 is not possible: it must be at least 1.\n"
    assert not (tmp_path / "out").exists()
