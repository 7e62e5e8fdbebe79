"""A sweep on a real Slurm of one node, which this file starts on loopback, comes to the same bits as one here."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import jax
import pytest
import tomli_w

from apollonius.arenas.file import to_dict
from apollonius.game.starts import Starts
from tests.learn.tiny import STOPPING

RUN = replace(STOPPING, game=replace(STOPPING.game, starts=Starts(separation=2.5)))
PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "scontrol")
SECONDS = 900
"""Most time that a sweep may take."""
STARTED: list[subprocess.Popen[str]] = []
CONFIG = """
ClusterName=trial
SlurmctldHost=localhost(127.0.0.1)
SlurmUser=root
SlurmctldPort=26827
SlurmdPort=26828
AuthInfo=socket={0}/munge.socket,cred_expire=5
StateSaveLocation={0}/state
SlurmdSpoolDir={0}/spool
SlurmctldPidFile={0}/slurmctld.pid
SlurmdPidFile={0}/slurmd.pid
SlurmctldLogFile={0}/slurmctld.log
SlurmdLogFile={0}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
ReturnToService=2
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
KillWait=10
NodeName=localhost NodeAddr=127.0.0.1 CPUs=2 RealMemory=4000
PartitionName=main Nodes=localhost Default=YES MaxTime=INFINITE State=UP
"""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(2 * SECONDS),
    pytest.mark.skipif(not all(map(shutil.which, PROGRAMS)) or os.geteuid() != 0, reason="needs Slurm, and to be root"),
]


def until(holds, seconds=60):
    """Wait for what comes true by itself."""
    end = time.monotonic() + seconds
    while not (found := holds()):
        assert time.monotonic() < end, "it takes too long"
        time.sleep(0.2)
    return found


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    """A cluster of this machine alone."""
    pytest.importorskip("submitit", reason="needs submitit: pip install submitit")
    folder = tmp_path_factory.mktemp("slurm")
    for name in ("state", "spool"):
        (folder / name).mkdir()
    key, config = folder / "munge.key", folder / "slurm.conf"
    key.write_bytes(os.urandom(128))
    key.chmod(0o400)
    config.write_text(CONFIG.format(folder))
    munge = {"key-file": key, "socket": folder / "munge.socket", "pid-file": folder / "munge.pid"}
    munge |= {"log-file": folder / "munge.log", "seed-file": folder / "munge.seed", "num-threads": 1}
    daemons = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SLURM_CONF", str(config))
        patch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
        patch.setenv("JAX_COMPILATION_CACHE_DIR", str(jax.config.jax_compilation_cache_dir))
        patch.setenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
        try:
            options = [f"--{name}={value}" for name, value in munge.items()]
            for command in (
                ["munged", "-F", "-f", *options],
                ["slurmctld", "-D", "-i"],
                ["slurmd", "-D", "-N", "localhost"],
            ):
                daemons.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
                time.sleep(1)
            until(lambda: "idle" in subprocess.run(["sinfo"], capture_output=True, text=True).stdout)
            yield folder
        finally:
            for daemon in reversed(daemons):
                daemon.terminate()
                daemon.wait(30)


@pytest.fixture(autouse=True)
def end_all():
    """No command outlives its test."""
    yield
    while STARTED:
        (process := STARTED.pop()).terminate()
        process.wait(60)


def apollonius(*arguments):
    command = [sys.executable, "-m", "apollonius", *map(str, arguments)]
    STARTED.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
    return STARTED[-1]


def listed_runs(folder):
    """What `apollonius runs` says of each run."""
    said, _ = apollonius("runs", folder, "--json").communicate(timeout=60)
    return {Path(run["folder"]).name: run for run in json.loads(said)["runs"]}


def weights(folder):
    """A digest of each agent of a sweep."""
    return {
        str(path.relative_to(folder)): sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.glob("*/agents/*.safetensors"))
    }


def running_record(run):
    """The record of a run's process that trains and has begun to write metrics; None where there is none."""
    state, lines = run / "state.json", run / "metrics.jsonl"
    if not state.exists() or not lines.exists() or not lines.stat().st_size:
        return None
    found = json.loads(state.read_text())
    return found if found["state"] == "running" else None


def test_slurm_sweep_with_killed_and_preempted_jobs_matches_local_sweep(slurm, tmp_path):
    config = to_dict(RUN)
    for stage in config["stages"]:
        stage["env_steps"] = 6 * 8192  # long enough to be caught in the middle
    (tmp_path / "config.toml").write_text(tomli_w.dumps(config))
    asked = [
        "train",
        "--config",
        tmp_path / "config.toml",
        "--seeds",
        "0-2",
        "--vary",
        "algorithm.learning_rate=1e-2,1e-3",
    ]
    here, there = tmp_path / "here", tmp_path / "there"
    _, said = (process := apollonius(*asked, "--out", here)).communicate(timeout=SECONDS)
    assert process.returncode == 0, said
    sweep = apollonius(*asked, "--on", "slurm", "--out", there)
    killed, preempted = (there / f"algorithm.learning_rate=0.01,seed={seed}" for seed in (0, 1))
    first = until(lambda: running_record(killed), SECONDS)
    os.kill(first["process"], signal.SIGKILL)
    job = until(lambda: running_record(preempted), SECONDS)["job"]
    assert listed_runs(there)[preempted.name]["state"]["job"] == job
    subprocess.run(["scontrol", "requeue", job], check=True)
    _, said = sweep.communicate(timeout=SECONDS)
    assert sweep.returncode == 0, said
    found = listed_runs(there)
    assert {run["state"]["state"] for run in found.values()} == {"finished"}
    assert {run["share"] for run in found.values()} == {1.0}
    assert found[killed.name]["state"]["job"] != first["job"]
    assert found[preempted.name]["state"]["job"] == job
    restarts = subprocess.run(["scontrol", "show", "job", job], capture_output=True, text=True).stdout
    assert "Restarts=1" in restarts
    assert len(weights(here)) == 54
    assert weights(there) == weights(here)
