"""Independent jobs and Ctrl-C in real processes: what fails is told, what is stopped goes on, and soon."""

import os
import signal
import subprocess
import sys
import warnings
from dataclasses import replace

import jax
import pytest

from apollonius.io import workers as jobs_module
from apollonius.io.errors import InvalidInput
from apollonius.io.interrupts import asked
from apollonius.io.workers import Job, run_jobs
from apollonius.learn import run as run_module
from apollonius.learn.folder import create_run, load_config
from apollonius.learn.run import train
from tests.learn.tiny import CHUNK, RUN


def write_down(path):
    assert not asked()
    path.write_text(str(os.getpid()))
    return True


def refuse(path):
    raise InvalidInput("this cannot be")


def stop(path):
    return False


def interrupt_all(path):
    """Ctrl-C, as a terminal sends it: to every process."""
    for pid in (os.getppid(), os.getpid()):
        os.kill(pid, signal.SIGINT)
    return not asked()


def be_ended_by_ctrl_c(path):
    """As one that is interrupted when its interpreter has let go of signals."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    interrupt_all(path)


def jobs_of(work, folder, count=3):
    return [Job(f"job {number}", work, (folder / str(number),)) for number in range(count)]


@pytest.fixture
def one_core(monkeypatch):
    """Jobs run one after the other."""
    monkeypatch.setattr(jobs_module, "available_cores", lambda: [0])


@pytest.mark.usefixtures("one_core")
def test_every_job_is_done_in_a_process_of_its_own(tmp_path):
    told = []
    assert run_jobs(jobs_of(write_down, tmp_path, 2), told.append) == [True, True]
    processes = {path.read_text() for path in tmp_path.iterdir()}
    assert len(processes) == 2
    assert str(os.getpid()) not in processes
    assert sorted(told) == ["done: job 0", "done: job 1"]


@pytest.mark.slow
@pytest.mark.usefixtures("one_core")
def test_a_job_that_fails_is_named_at_the_end_and_the_others_are_done(tmp_path):
    failing = [replace(job, name=f"bad {job.name}") for job in jobs_of(refuse, tmp_path, 1)]
    told = []
    with pytest.raises(InvalidInput, match=r"1 of 4 failed \(bad job 0\)"):
        run_jobs([*failing, *jobs_of(write_down, tmp_path)], told.append)
    assert told[0] == "failed: bad job 0 (this cannot be)"
    assert told[1:] == [f"done: job {number}" for number in range(3)]
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.slow
@pytest.mark.usefixtures("one_core")
@pytest.mark.parametrize("work", [stop, interrupt_all, be_ended_by_ctrl_c])
def test_after_a_job_that_was_stopped_none_begins(tmp_path, work):
    told = []
    stopped = [replace(job, name="first") for job in jobs_of(work, tmp_path, 1)]
    with pytest.raises(KeyboardInterrupt):
        run_jobs([*stopped, *jobs_of(write_down, tmp_path)], told.append)
    assert not list(tmp_path.iterdir())
    assert told == ["stopped: first"]


def test_an_unknown_place_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match=r"on = moon .*processes, slurm, ray"):
        run_jobs(jobs_of(write_down, tmp_path), print, on="moon")
    assert not list(tmp_path.iterdir())


def train_and_be_lost_once(folder):
    """A training whose worker is killed in the middle, the first time."""

    def die_in_the_middle(line, share):
        if line.env_steps == 3 * CHUNK and not (folder / "lost").exists():
            (folder / "lost").touch()
            os.kill(os.getpid(), signal.SIGKILL)

    run_module.CHECKPOINT_SECONDS = 0.0
    return run_module.Run(load_config(folder / "config.toml"), folder, die_in_the_middle).execute()


@pytest.fixture
def ray(monkeypatch):
    """Workers share the compilations of the tests."""
    pytest.importorskip("ray")
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(jax.config.jax_compilation_cache_dir))
    monkeypatch.setenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@pytest.mark.slow
def test_a_sweep_on_ray_with_a_lost_worker_comes_to_the_same_as_one_here(ray, tmp_path):
    """Two seeds, one of whose workers is killed: the same agents to the last bit."""
    folders = {}
    for place in ("here", "ray"):
        folders[place] = [tmp_path / place / f"seed-{seed}" for seed in range(2)]
        for seed, folder in enumerate(folders[place]):
            create_run(replace(RUN, stages="self-play", seed=seed), folder)
    with jax.numpy_dtype_promotion("standard"):  # as Adam in optax needs it
        for folder in folders["here"]:
            assert train(folder)
    works = (train_and_be_lost_once, train)
    jobs = [Job(folder.name, work, (folder,)) for folder, work in zip(folders["ray"], works, strict=True)]
    run_jobs(jobs, print, on="ray")
    assert (folders["ray"][0] / "lost").exists()
    for here, there in zip(folders["here"], folders["ray"], strict=True):
        agents = {path.name: path.read_bytes() for path in (here / "agents").iterdir()}
        assert len(agents) == 8
        assert {path.name: path.read_bytes() for path in (there / "agents").iterdir()} == agents


@pytest.mark.slow
def test_a_job_that_fails_on_ray_is_named(ray, tmp_path):
    told = []
    with pytest.raises(InvalidInput, match=r"1 of 1 failed \(job 0\)"):
        run_jobs(jobs_of(refuse, tmp_path, 1), told.append, on="ray")
    assert told == ["failed: job 0 (this cannot be)"]


SOON = 2.0 + 6.0
"""Seconds from Ctrl-C to the end of a program: what is promised, and what a busy machine may add."""
COMMAND = "import sys; from apollonius.__main__ import main; print('begun', flush=True); sys.exit(main())"
"""A program hears from its first tenth of a second on, which a busy machine makes longer: so it has begun then."""


def interrupted(code, *arguments, after=0.0, folder=None):
    """Status, output and errors of a program that gets a Ctrl-C some seconds after its first line of output."""
    with subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder,
    ) as process:  # fmt: skip
        try:
            assert process.stdout.readline() == "begun\n"
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(after)
            process.send_signal(signal.SIGINT)
            output, errors = process.communicate(timeout=SOON)
        finally:
            process.kill()
    return process.returncode, output, errors


PLAYS = ["evaluate", "random", "random", "--games", str(10**6)]


@pytest.mark.parametrize(
    "after", [0.5, pytest.param(6.0, marks=pytest.mark.slow)], ids=["while it loads or compiles", "while it plays"]
)
def test_a_long_match_stops(after):
    status, output, errors = interrupted(COMMAND, *PLAYS, after=after)
    assert (status, output) == (130, "")
    assert errors.splitlines()[-1] == "stopped"
    assert "Traceback" not in errors


@pytest.mark.parametrize("loading", ["apollonius.io.interrupts", "apollonius.cli.train"])
def test_ctrl_c_while_the_command_itself_is_loaded_is_no_traceback(loading):
    early = f"""
import os, runpy, signal, sys

class Interrupts:
    def find_spec(self, name, *_):
        if name == {loading!r}:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupts())
runpy.run_module("apollonius", run_name="__main__", alter_sys=True)
"""
    done = subprocess.run([sys.executable, "-c", early, *PLAYS[:3]], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "stopped\n")


def test_a_program_that_cannot_hear_is_ended_and_says_how_to_go_on():
    """A single call into native code, as a compilation is one, here of some minutes."""
    deaf = """
import hashlib
from apollonius.io.interrupts import go_on, listen
listen()
go_on("go on with: patience")
print("begun", flush=True)
hashlib.pbkdf2_hmac("sha256", b"", b"", 10**9)
"""
    assert interrupted(deaf, after=0.2) == (130, "", "stopped; go on with: patience\n")


def test_a_program_that_has_heard_may_take_its_time_to_save():
    saving = """
import signal, sys, time
from apollonius.io import interrupts
heard = []
interrupts.listen()
signal.signal(signal.SIGINT, lambda *_: heard.append(True))
print("begun", flush=True)
while not heard:
    time.sleep(0.01)
interrupts._answered.set()
time.sleep(interrupts.PATIENCE + 0.5)
print("saved")
sys.exit(5)
"""
    assert interrupted(saving, after=0.2) == (5, "saved\n", "")
