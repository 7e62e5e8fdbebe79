"""Calls of functions on workers, which return what they return to the one who asked."""

from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from apollonius.io.document import parse_json, to_json, write_atomically
from apollonius.io.workers import Job, run_jobs


def call_all(calls: Mapping[str, tuple[Any, ...]], report: Callable[[str], None], on: str) -> dict[str, Any]:
    """Call functions as jobs, and return what each returns, JSON-like data, by its name.

    Args:
        calls: a function that can be imported by its name, and its arguments.
        report, on: as of `run_jobs`, whose errors are raised.

    Raises:
        KeyboardInterrupt: when they were stopped; what has been computed is lost.
    """
    with TemporaryDirectory(prefix=".apollonius-", dir=Path.cwd()) as folder:  # where workers elsewhere find it, too
        files = {name: Path(folder) / f"{number}.json" for number, name in enumerate(calls)}
        jobs = [Job(name, _keep, (files[name], *call)) for name, call in calls.items()]
        if not run_jobs(jobs, report, on, Path(folder)):
            raise KeyboardInterrupt
        return {name: parse_json(path.read_bytes(), str(path)) for name, path in files.items()}


def _keep(path: Path, function: Callable[..., Any], *rest: Any) -> bool:
    *arguments, _ = rest  # a call is too short to be stopped
    write_atomically(path, to_json(function(*arguments)).encode())
    return True
