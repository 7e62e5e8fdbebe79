"""A study as a command: its options, how many jobs run at a time and what they share, and what it writes."""

import json
import os
from dataclasses import dataclass

import pytest

from apollonius.errors import InvalidInput, exit_status
from apollonius.evaluate.round_robin import RoundRobin
from apollonius.game.by_side import BySide
from apollonius.jobs import available_cores
from apollonius.reproduce.finding import Finding
from studies import driver, robust, schemes, sensitivity, smooth


@dataclass(frozen=True, kw_only=True)
class Counting(driver.AbstractStudy):
    """Plays nothing, and says what it was asked."""

    name = "counting"
    what: str = driver.option(help="what is counted")
    wait_for: str | None = driver.option(None, help="nobody by default")
    games: int = driver.option(7)

    def finding(self):
        return Finding("Counted", f"{self.games} {self.what}", ("one.png",), data={"games": self.games})


@pytest.fixture(autouse=True)
def no_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path))


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


def test_jobs_share_their_compilations_unless_a_place_is_given(tmp_path, monkeypatch):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "elsewhere")
    driver.main(Counting, ["sheep", "--out", str(tmp_path)])
    assert os.environ["JAX_COMPILATION_CACHE_DIR"] == "elsewhere"
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR")
    driver.main(Counting, ["sheep", "--out", str(tmp_path)])
    assert os.environ["JAX_COMPILATION_CACHE_DIR"] == str(tmp_path / ".jax_cache")


@pytest.mark.parametrize("study", [robust, schemes, sensitivity, smooth])
@pytest.mark.parametrize("counted", ["--seeds", "--games", "--processes"])
def test_a_study_of_none_is_refused_in_one_line(study, counted, tmp_path, capsys):
    assert exit_status(lambda: study.main([counted, "0", "--out", str(tmp_path / "out")])) == 2
    assert capsys.readouterr().err == f"{counted} = 0 is not possible: it must be at least 1.\n"
    assert not (tmp_path / "out").exists()


def test_entrants_are_others_and_the_last_agents_of_runs(tmp_path):
    others = BySide(("P_scratch",), ("E_scratch", "random"))
    found = driver.entrants(others, {"latest/seed-0": tmp_path / "latest"})
    assert [list(side) for side in found] == [["P_scratch", "latest/seed-0"], ["E_scratch", "random", "latest/seed-0"]]
    assert found.evader["random"] == "random"
    assert found.evader["latest/seed-0"] == str(tmp_path / "latest" / "agents" / "E_curriculum.safetensors")


def test_players_who_are_kept_apart_meet_their_own_and_everyone_else(tmp_path):
    names = dict.fromkeys(("stranger", "seed-0", "seed-1"), "random")
    everyone = RoundRobin(tmp_path, BySide(names, names), 1, 0, apart=("seed-0", "seed-1"))
    assert [everyone.row(name) for name in names] == [list(names), ["stranger", "seed-0"], ["stranger", "seed-1"]]


def test_a_study_is_refused_what_it_cannot_play(tmp_path):
    with pytest.raises(InvalidInput, match=r"--config = .*none.toml"):
        robust.main(["--out", str(tmp_path / "out"), "--config", str(tmp_path / "none.toml")])
    assert not (tmp_path / "out").exists()
