"""The progress of a training run: its last process, the share of the training that is done, its
last evaluation.
"""

import os
import platform
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

from apollonius.arenas.file import from_dict
from apollonius.io.document import parse_json, read_bytes, to_json, write_atomically
from apollonius.io.errors import InvalidInput, require_within
from apollonius.io.limits import MOST_COUNTED
from apollonius.learn.folder import METRICS, Evaluation, load_config, lock_run
from apollonius.learn.metrics import MetricsLine, last_lines

STATE = "state.json"
"""Name of the file in a run's folder with its `ProcessStatus`."""


@dataclass(frozen=True)
class ProcessStatus:
    """The last process that trained a run: its number on its machine and in Slurm, and why it
    failed if it did.

    A run that was stopped or killed can be resumed.
    """

    state: Literal["waiting", "running", "stopped", "finished", "failed"] = "waiting"
    machine: str = ""
    process: int = 0
    job: str = ""
    error: str = ""

    def __post_init__(self) -> None:
        require_within(self, 0, MOST_COUNTED, "process")


def load_status(path: Path) -> ProcessStatus:
    """Return the state of a run by its file, if there is one; raises InvalidInput for a bad one."""
    if not path.exists():
        return ProcessStatus()
    content = read_bytes(path, "a run's state", "train again")
    return from_dict(
        ProcessStatus,
        parse_json(content, f"'{path}' is no record of a process; train again"),
        f"'{path}'",
    )


def record_status(folder: Path, train: Callable[[], bool]) -> bool:
    """Hold a run's folder (`lock_run`) while it is trained, keep its `ProcessStatus` on file, and
    return if it finished.
    """

    def write(state: ProcessStatus) -> None:
        write_atomically(folder / STATE, to_json(asdict(state)).encode())

    array, task = os.environ.get("SLURM_ARRAY_JOB_ID"), os.environ.get("SLURM_ARRAY_TASK_ID")
    job = f"{array}_{task}" if array else os.environ.get("SLURM_JOB_ID", "")
    with lock_run(folder):
        write(ended := ProcessStatus("running", platform.node(), os.getpid(), job))
        try:
            finished = train()
            ended = replace(ended, state="finished" if finished else "stopped")
            return finished
        except Exception as error:
            ended = replace(ended, state="failed", error=str(error) or type(error).__name__)
            raise
        finally:
            with suppress(OSError):  # a full disk, of which the error itself tells
                write(replace(ended, state="stopped") if ended.state == "running" else ended)


def _was_killed(state: ProcessStatus) -> bool:
    """Check whether a process that runs by its record is not there any more, as far as this machine
    knows.
    """
    try:
        if state.machine == platform.node():
            os.kill(state.process, 0)
    except ProcessLookupError:
        return True
    except OSError:  # another user's
        pass
    return False


@dataclass(frozen=True)
class Progress:
    """The progress of a run: the share of the training that is done, its last chunk and its last
    greedy evaluation.

    `age` is the time since its last process was heard of [s].
    """

    folder: Path
    state: ProcessStatus
    share: float
    line: MetricsLine | None
    evaluation: Evaluation | None
    age: float | None


def runs_below(folder: Path) -> list[Path]:
    """Return the folders of runs at or below a folder, by name."""
    return sorted(path.parent for path in folder.rglob("config.toml"))


def mean_share(runs: Sequence[Path]) -> float:
    """Return the share of several trainings that is done."""
    return sum(progress_of(run).share for run in runs) / max(1, len(runs))


def progress_of(run: Path) -> Progress:
    """Return the progress of a run; one whose files cannot be read has failed."""
    try:
        state, config = load_status(run / STATE), load_config(run / "config.toml")
        if state.state == "running" and _was_killed(state):
            state = replace(state, state="stopped")
        line, evaluation = last_lines(run / METRICS)
        share = config.share(line.stage, line.env_steps) if line else 0.0
        times = [file.stat().st_mtime for file in (run / STATE, run / METRICS) if file.exists()]
        age = (
            min(max(0.0, time.time() - max(times)), MOST_COUNTED) if times else None
        )  # clocks differ, and may be odd
        return Progress(run, state, share, line, evaluation, age)
    except (InvalidInput, OSError) as error:
        return Progress(run, ProcessStatus("failed", error=str(error)), 0.0, None, None, None)
