"""How many jobs of a study run at a time, and what they share; what is refused is refused in one line."""

import os

import pytest

from apollonius.errors import InvalidInput, exit_status
from apollonius.jobs import available_cores
from studies import robust, schemes, smooth
from studies.driver import chosen_cores


def test_fewer_jobs_at_a_time_than_one_are_refused_and_there_are_no_more_than_cores(tmp_path, monkeypatch):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path))
    for processes in (0, -1):
        with pytest.raises(InvalidInput, match=f"--processes = {processes} .* at least 1"):
            chosen_cores(processes, tmp_path)
    assert chosen_cores(1, tmp_path) == available_cores()[:1]
    assert chosen_cores(None, tmp_path) == chosen_cores(10_000, tmp_path) == available_cores()


def test_jobs_share_their_compilations_unless_a_place_is_given(tmp_path, monkeypatch):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "elsewhere")
    chosen_cores(None, tmp_path)
    assert os.environ["JAX_COMPILATION_CACHE_DIR"] == "elsewhere"
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR")
    chosen_cores(None, tmp_path)
    assert os.environ["JAX_COMPILATION_CACHE_DIR"] == str(tmp_path / ".jax_cache")


@pytest.mark.parametrize("study", [robust, schemes, smooth])
def test_a_study_without_seeds_is_refused_in_one_line(study, capsys):
    assert exit_status(lambda: study.main(["--seeds", "0"])) == 2
    assert capsys.readouterr().err == "--seeds = 0 is not possible: it must be at least 1.\n"
