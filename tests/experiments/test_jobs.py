"""Independent jobs: each is done once, in a process of its own; what fails is told, what is stopped goes on."""

import os
import signal

import pytest

from apollonius.errors import InvalidInput
from apollonius.experiments.jobs import Job, run_jobs


def write_down(path, should_stop):
    assert not should_stop()
    path.write_text(str(os.getpid()))
    return True


def refuse(path, should_stop):
    raise InvalidInput("this cannot be")


def stop(path, should_stop):
    return False


def interrupt_all(path, should_stop):
    """Ctrl-C, as a terminal sends it: to every process."""
    for pid in (os.getppid(), os.getpid()):
        os.kill(pid, signal.SIGINT)
    return not should_stop()


def jobs_of(work, folder, count=3):
    return [Job(f"job {number}", work, (folder / str(number),)) for number in range(count)]


def test_every_job_is_done_in_a_process_of_its_own(tmp_path):
    told = []
    assert run_jobs(jobs_of(write_down, tmp_path), [0], told.append)
    processes = {path.read_text() for path in tmp_path.iterdir()}
    assert len(processes) == 3
    assert str(os.getpid()) not in processes
    assert sorted(told) == ["done: job 0", "done: job 1", "done: job 2"]


def test_a_job_that_fails_is_named_and_none_begins_after_it(tmp_path, capfd):
    with pytest.raises(InvalidInput, match="job 0 failed"):
        run_jobs([*jobs_of(refuse, tmp_path, 1), *jobs_of(write_down, tmp_path)], [0], print)
    assert "job 0: this cannot be" in capfd.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("work", [stop, interrupt_all])
def test_after_a_job_that_was_stopped_none_begins(tmp_path, work):
    assert not run_jobs([*jobs_of(work, tmp_path, 1), *jobs_of(write_down, tmp_path)], [0], lambda line: None)
    assert not list(tmp_path.iterdir())
