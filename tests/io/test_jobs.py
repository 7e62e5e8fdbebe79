"""Independent jobs and Ctrl-C in real processes: what fails is told, what is stopped goes on, and soon."""

import os
import signal
import subprocess
import sys
from unittest.mock import MagicMock

import pytest

from apollonius.io import workers as jobs_module
from apollonius.io.errors import InvalidInput
from apollonius.io.interrupts import should_stop, stopping_on_signals
from apollonius.io.workers import Job, run_jobs


def write_down(path):
    assert not should_stop()
    path.write_text(str(os.getpid()))
    return True


def refuse(path):
    write_down(path)
    raise InvalidInput("this cannot be")


def stop(path):
    return False


def interrupt_all(path):
    """Ctrl-C, as a terminal sends it: to every process."""
    for pid in (os.getppid(), os.getpid()):
        os.kill(pid, signal.SIGINT)
    return not should_stop()


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
def test_each_job_runs_in_its_own_process_and_failures_are_named(tmp_path):
    told, failing = [], Job("bad job", refuse, (tmp_path / "bad job",))
    with pytest.raises(InvalidInput, match=r"1 of 2 failed \(bad job\)"):
        run_jobs([failing, *jobs_of(write_down, tmp_path, 1)], told.append)
    assert told == ["failed: bad job (this cannot be)", "done: job 0"]
    processes = {path.read_text() for path in tmp_path.iterdir()}
    assert len(processes) == 2
    assert str(os.getpid()) not in processes


@pytest.mark.slow
@pytest.mark.usefixtures("one_core")
@pytest.mark.parametrize("work", [stop, interrupt_all, be_ended_by_ctrl_c])
def test_no_job_begins_after_one_was_stopped(tmp_path, work):
    told, first = [], Job("first", work, (tmp_path / "first",))
    with pytest.raises(KeyboardInterrupt):
        run_jobs([first, *jobs_of(write_down, tmp_path)], told.append)
    assert not list(tmp_path.iterdir())
    assert told == ["stopped: first"]


def test_unknown_worker_kind_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match=r"on = moon .*processes, slurm, ray"):
        run_jobs(jobs_of(write_down, tmp_path), print, on="moon")
    assert not list(tmp_path.iterdir())


def be_lost_once(path):
    """A job whose worker is killed, the first time."""
    if not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return write_down(path)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_ray_repeats_a_job_of_a_lost_worker_and_names_a_failed_one(tmp_path):
    pytest.importorskip("ray", reason="needs ray: pip install ray")
    told, works = [], (be_lost_once, refuse, write_down)
    jobs = [Job(work.__name__, work, (tmp_path / work.__name__,)) for work in works]
    with pytest.raises(InvalidInput, match=r"1 of 3 failed \(refuse\)"):
        run_jobs(jobs, told.append, on="ray")
    assert sorted(told) == ["done: be_lost_once", "done: write_down", "failed: refuse (this cannot be)"]
    assert all((tmp_path / work.__name__).read_text() for work in (be_lost_once, write_down))


def run_out_of_memory(path):
    raise MemoryError


@pytest.mark.usefixtures("one_core")
def test_error_without_a_message_is_reported_by_its_type(tmp_path):
    told = []
    with pytest.raises(InvalidInput, match="1 of 1 failed"):
        run_jobs(jobs_of(run_out_of_memory, tmp_path, 1), told.append)
    assert told == ["failed: job 0 (MemoryError)"]


def test_ray_listens_locally_and_its_failure_to_start_is_one_line(tmp_path, monkeypatch):
    ray = MagicMock()
    ray.init.side_effect = Exception("The current node timed out during startup.\nThis could happen")
    monkeypatch.setitem(sys.modules, "ray", ray)
    monkeypatch.setitem(sys.modules, "ray.exceptions", ray)
    monkeypatch.setattr("apollonius.io.errors.find_spec", lambda module: module)
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    with pytest.raises(InvalidInput, match=r"^Ray does not start \(The current .* could happen\): .*RAY_ADDRESS\.$"):
        run_jobs(jobs_of(write_down, tmp_path), print, on="ray")
    assert ray.init.call_args.kwargs["_node_ip_address"] == "127.0.0.1"
    monkeypatch.setenv("RAY_ADDRESS", "10.0.0.1:6379")
    with pytest.raises(InvalidInput, match="Ray does not start"):
        run_jobs(jobs_of(write_down, tmp_path), print, on="ray")
    assert ray.init.call_args.kwargs == {"log_to_driver": False}


class Refusal(Exception):
    """What `submitit` raises where `sbatch` takes no job."""


@pytest.fixture
def array(tmp_path, monkeypatch):
    """What answers in place of `submitit.SlurmExecutor.map_array`."""
    slurm = MagicMock()
    slurm.core.utils.FailedSubmissionError = slurm.core.utils.FailedJobError = Refusal
    slurm.helpers.Checkpointable = object
    monkeypatch.setitem(sys.modules, "submitit", slurm)
    monkeypatch.setattr("apollonius.io.errors.find_spec", lambda module: module)
    monkeypatch.chdir(tmp_path)
    return slurm.SlurmExecutor.return_value.map_array


def test_sbatch_refusal_is_one_line(array, tmp_path):
    array.side_effect = Refusal("no such partition")
    with pytest.raises(InvalidInput, match=r"^sbatch refuses the jobs \(no such partition\): correct .* and go on\.$"):
        run_jobs(jobs_of(write_down, tmp_path), print, on="slurm")


class Queue:
    """A Slurm of one look after the other: at each one `on_look` may change what is listed and who has a result."""

    def __init__(self, array, monkeypatch):
        self.array, self.executor = array, sys.modules["submitit"].SlurmExecutor.return_value
        self.listed, self.looks, self.cancelled = set(), 0, []
        self.on_look = lambda look: None
        array.side_effect = lambda call, jobs: [self.copy(f"7_{number}") for number in range(len(jobs))]
        self.executor.submit.side_effect = lambda call, job: self.copy(f"8_{self.looks}")
        self.copies = {}
        monkeypatch.setattr(jobs_module, "POLL_SECONDS", 0.0)
        monkeypatch.setattr(jobs_module, "_LOOKS_WHEN_LOST", 5)
        monkeypatch.setattr(jobs_module.subprocess, "run", self.run)

    def copy(self, number):
        self.copies[number] = one = MagicMock(job_id=number)
        one.paths.result_pickle.exists.return_value, one.exception.return_value = False, None
        return one

    def end(self, number, *ending):
        self.listed.discard(number)
        self.copies[number].paths.result_pickle.exists.return_value = True
        self.copies[number].result.return_value = ending

    def run(self, command, **_):
        if command[0] == "scancel":
            self.cancelled += command[1:]
            self.listed.difference_update(command[1:])
        if command[0] == "squeue":
            self.looks += 1
            assert self.looks < 100
            self.on_look(self.looks)
        return MagicMock(
            returncode=0, stdout="MaxArraySize = 2\n" if command[0] == "scontrol" else " ".join(self.listed)
        )


@pytest.fixture
def queue(array, monkeypatch):
    return Queue(array, monkeypatch)


def test_ctrl_c_cancels_running_slurm_jobs_and_keeps_finished_ones(queue, tmp_path, monkeypatch):
    told = []
    monkeypatch.setattr(jobs_module, "should_stop", lambda: bool(told))

    def look(number):
        if number == 1:
            queue.listed.add("7_1")
            queue.end("7_0", "done", True)

    queue.on_look = look
    with pytest.raises(KeyboardInterrupt):
        run_jobs(jobs_of(write_down, tmp_path, 2), told.append, on="slurm")
    assert told == ["done: job 0", "stopped: job 1"]
    assert queue.cancelled == ["7_1"]


def test_late_slurm_listing_and_late_result_cause_no_resubmission(queue, tmp_path):
    def look(number):
        (queue.listed.update if 4 < number < 6 else queue.listed.difference_update)(["7_0"])
        if number == 10:
            queue.end("7_0", "done", 36)

    queue.on_look = look
    assert run_jobs(jobs_of(write_down, tmp_path, 1), print, on="slurm") == [36]
    queue.executor.submit.assert_not_called()
    assert queue.cancelled == []


def test_lost_job_is_resubmitted_and_a_late_first_result_counts(queue, tmp_path):
    def look(number):
        if number == 7:
            queue.listed.add(number_of_second())
        if number == 9:
            queue.end("7_0", "done", 36)

    def number_of_second():
        (second,) = set(queue.copies) - {"7_0"}
        return second

    queue.on_look = look
    assert run_jobs(jobs_of(write_down, tmp_path, 1), print, on="slurm") == [36]
    assert queue.cancelled == ["7_0", "8_5"]


def test_requeued_job_is_awaited_and_a_failed_one_is_reported(queue, tmp_path):
    """A preempted job leaves a result that says so, and may be out of the queue for a moment."""
    told = []

    def look(number):
        if number == 2:
            queue.end("7_0", "stopped", False)
            queue.end("7_1", "no such agent", None)
        if number == 4:
            queue.listed.add("7_0")
        if number == 6:
            queue.end("7_0", "done", 36)

    queue.on_look = look
    with pytest.raises(InvalidInput, match="1 of 2 failed"):
        run_jobs(jobs_of(write_down, tmp_path, 2), told.append, on="slurm")
    assert told == ["failed: job 1 (no such agent)", "done: job 0"]


def test_repeatedly_lost_job_fails_despite_one_sbatch_refusal(queue, tmp_path):
    queue.executor.submit.side_effect = [Refusal("busy"), *(queue.copy(f"9_{number}") for number in range(9))]
    told = []
    with pytest.raises(InvalidInput, match="1 of 1 failed"):
        run_jobs(jobs_of(write_down, tmp_path, 1), told.append, on="slurm")
    assert "it was lost 11 times" in told[0]


def test_job_arrays_respect_the_limit_of_the_cluster(queue, tmp_path):
    sizes = []

    def submit(call, jobs):
        sizes.append(len(jobs))
        made = [queue.copy(f"{len(sizes)}_{number}") for number in range(len(jobs))]
        for one in made:
            queue.end(one.job_id, "done", one.job_id)
        if len(sizes) == 4:
            raise Refusal("too many jobs")
        return made

    queue.array.side_effect = submit
    assert run_jobs(jobs_of(write_down, tmp_path, 3), print, on="slurm") == ["1_0", "1_1", "2_0"]
    assert sizes == [2, 1]
    with pytest.raises(InvalidInput, match="sbatch refuses the jobs"):
        run_jobs(jobs_of(write_down, tmp_path, 3), print, on="slurm")
    assert queue.cancelled == ["3_0", "3_1"]


SOON = 2.0 + 6.0
"""Seconds from Ctrl-C to the end of a program: what is promised, and what a busy machine may add."""
COMMAND = """
import atexit, os, sys
from apollonius.__main__ import main
print("begun", flush=True)
status = main()
atexit.register(os.abort)
sys.exit(status)
"""
"""The command. It listens from its first tenth of a second on, which a busy machine makes longer: so it begins then.

Nothing is left to the interpreter's finalisation, which may crash."""


def run_interrupted(code, *arguments, after):
    """Status, output and errors of a program that gets a Ctrl-C some seconds after its first line of output."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", code, *arguments], **pipes) as process:
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
def test_ctrl_c_stops_a_long_match(after):
    status, output, errors = run_interrupted(COMMAND, *PLAYS, after=after)
    assert (status, output) == (130, "")
    assert errors.splitlines()[-1] == "stopped"
    assert "Traceback" not in errors


@pytest.mark.parametrize("loading", ["apollonius.io.interrupts", "apollonius.cli.train"])
def test_ctrl_c_during_import_prints_no_traceback(loading):
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


def test_ctrl_c_between_import_and_command_prints_no_traceback():
    early = """
import argparse, os, signal, sys
from apollonius.__main__ import main
argparse.ArgumentParser.parse_args = lambda *_: os.kill(os.getpid(), signal.SIGINT)
print("begun", flush=True)
main()
"""
    assert run_program(early, "evaluate") == (130, "begun\n", "stopped\n")


def run_program(code, *arguments):
    """Status, output and errors of a program that interrupts itself."""
    command = [sys.executable, "-c", code, *arguments]
    environment = os.environ | {"PYTHONUNBUFFERED": ""}
    process = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, env=environment)
    return process.returncode, process.stdout, process.stderr


LISTENING = """
import hashlib, os, signal, sys, time
from apollonius.io import interrupts
from apollonius.io.interrupts import before_leaving, interrupt_status, leave, listen, should_stop, stopping_on_signals
listen()
"""


def test_ctrl_c_ends_a_blocked_program_with_its_resume_hint():
    """A single call into native code, as a compilation is one, here of some minutes."""
    blocked = """
interrupts.PATIENCE = 0.3
interrupts.set_resume_hint("go on with: patience")
signal.signal(signal.SIGWINCH, lambda *_: None)
os.kill(os.getpid(), signal.SIGWINCH)
time.sleep(0.6)  # goes on after a signal that stops no program
print("begun", flush=True)
hashlib.pbkdf2_hmac("sha256", b"", b"", 10**9)
"""
    assert run_interrupted(LISTENING + blocked, after=0.2) == (130, "", "stopped; go on with: patience\n")


def test_ctrl_c_ends_a_blocked_worker_without_a_line():
    blocked = (
        LISTENING.replace("listen()", "listen(says=False)")
        + """
print("begun", flush=True)
hashlib.pbkdf2_hmac("sha256", b"", b"", 10**9)
"""
    )
    assert run_interrupted(blocked, after=0.2) == (130, "", "")


def test_ctrl_c_does_not_unwind_an_import(tmp_path):
    """NumPy's modules of C print the traceback of an exception; this one does as if."""
    (tmp_path / "printing.py").write_text("""
import os, signal, traceback
try:
    os.kill(os.getpid(), signal.SIGINT)
except BaseException:
    traceback.print_exc()
""")
    importing = "interrupts.PATIENCE = 60.0; sys.path.insert(0, sys.argv[1]); import printing"
    assert run_program(LISTENING + importing, str(tmp_path)) == (130, "", "stopped\n")


def test_ctrl_c_as_memory_is_freed_is_not_lost():
    freeing = """
interrupts.PATIENCE = 60.0
class Freed:
    def __init__(self, act):
        self.act = act
    def __del__(self):
        self.act()
Freed(lambda: 1 / 0)
print("begun", flush=True)
Freed(lambda: os.kill(os.getpid(), signal.SIGTERM))
time.sleep(60)
"""
    status, output, errors = run_program(LISTENING + freeing)
    assert (status, output) == (143, "begun\n")
    assert errors.splitlines()[-1] == "stopped"
    assert errors.count("Traceback") == errors.count("ZeroDivisionError") == 1, "other errors are told as ever"


@pytest.mark.parametrize("fault", ["", "; 1 / 0", "; os.kill(os.getpid(), signal.SIGINT)"])
def test_live_view_is_taken_down_and_its_fault_does_not_keep_the_program(fault):
    viewing = f"""
def take_down():
    print("down", file=sys.stderr){fault}
before_leaving(take_down)
print("printed")
leave(7, "last words")
"""
    assert run_program(LISTENING + viewing) == (7, "printed\n", "down\nlast words\n")


def test_second_ctrl_c_while_leaving_an_import_does_not_hang(tmp_path):
    (tmp_path / "interrupting.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)")
    leaving = """
before_leaving(lambda: os.kill(os.getpid(), signal.SIGINT) if len(interrupts._handled) < 2 else None)
sys.path.insert(0, sys.argv[1])
import interrupting
"""
    assert run_program(LISTENING + leaving, str(tmp_path))[0] == 130


def test_program_that_handles_ctrl_c_may_take_its_time_to_save():
    saving = """
interrupts.PATIENCE = 0.3
print("begun", flush=True)
with stopping_on_signals():
    while not should_stop():
        time.sleep(0.01)
    time.sleep(0.8)
print("saved")
sys.exit(interrupt_status())
"""
    assert run_interrupted(LISTENING + saving, after=0.2) == (130, "saved\n", "")


@pytest.mark.parametrize(("again", "ending"), [(True, (130, "", "")), (False, (1, "saved\n", ""))])
def test_second_ctrl_c_interrupts_the_saving_where_that_is_wished(again, ending):
    saving = f"""
try:
    with stopping_on_signals(again={again}):
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
        print("saved")
    sys.exit(1)
except KeyboardInterrupt:
    leave(interrupt_status())
"""
    assert run_program(LISTENING + saving) == ending


def test_signals_count_for_one_block_only():
    before = signal.getsignal(signal.SIGTERM)
    with stopping_on_signals(again=False):
        os.kill(os.getpid(), signal.SIGTERM)
        assert should_stop()
    with stopping_on_signals(parent=os.getppid()):
        assert not should_stop()
    with stopping_on_signals(parent=1 - os.getppid()):
        assert should_stop(), "its parent is gone"
    assert signal.getsignal(signal.SIGTERM) == before
