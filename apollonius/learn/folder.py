"""The folder of a training run: its files, its lock, its configuration."""

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import tomli_w

from apollonius.arenas.record import from_dict, to_dict
from apollonius.io.document import parse_toml, read_bytes, write_atomically
from apollonius.io.errors import InvalidInput, require
from apollonius.learn.config import RunConfig

_HOLDER = ".process"
"""File with the id of the process that trains in a folder."""
_LONGEST_ID = 20


def create_run(config: RunConfig, folder: Path, force: bool = False) -> None:
    """Make the folder of a new run, with its config.

    Args:
        force: remove the run that is already there. Only a run's own files are removed.

    Raises:
        InvalidInput: when the folder holds a run and `force` is not given, or something that is no run.
        OSError: when it cannot be written.
    """
    if folder.exists():
        require(folder.is_dir(), "folder", folder, "a folder; choose another")
        if any(folder.iterdir()):
            is_run = (folder / "config.toml").is_file()
            require(is_run, "folder", folder, "a run's folder, new or empty, but holds something else; choose another")
            require(force, "folder", folder, "a new folder, as this one holds a run; choose another or force it")
            with held(folder):
                _remove_run(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / "config.toml", tomli_w.dumps(to_dict(config)).encode())
    (folder / "agents").mkdir(exist_ok=True)


@contextmanager
def held(folder: Path) -> Generator[None, None, None]:
    """Keep other processes from training in a run's folder, where the system can.

    Raises:
        InvalidInput: when one is training there.
    """
    try:
        import fcntl
    except ImportError:
        yield
        return
    holder, directory = folder / _HOLDER, os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(directory, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            process = holder.read_text()[:_LONGEST_ID] if holder.is_file() else "another"
            raise InvalidInput(f"'{folder}' is being trained by process {process}: wait for it, or stop it.") from error
        except OSError:
            pass  # a file system without locks
        for abandoned in folder.rglob("*.tmp"):  # by a process that was killed
            abandoned.unlink()
        holder.write_text(str(os.getpid()))
        try:
            yield
        finally:
            holder.unlink(missing_ok=True)
    finally:
        os.close(directory)


def agent_file(run: Path, name: str, percent: int = 100) -> Path:
    """Return the file of an agent: the one at the end of a run, or that at an earlier percentage of self-play."""
    return run / "agents" / f"{name}{'' if percent == 100 else f'-{percent}'}.safetensors"


def _remove_run(folder: Path) -> None:
    # The config goes last: until then a half-removed folder is still known as a run's.
    for pattern in (
        "agents/*.safetensors",
        "tables/*.safetensors",
        "checkpoint.safetensors",
        "*.jsonl",
        "evaluation.json",
        "report.html",
        _HOLDER,
        "config.toml",
    ):
        for path in folder.glob(pattern):
            path.unlink()


def load_config(path: Path, within: Path | None = None) -> RunConfig:
    """Return the config of a file as `create_run` writes it; what it leaves out has its default.

    Args:
        within: the folder that must contain the file, wherever links lead; None for any.

    Raises:
        InvalidInput: when it is missing, no TOML, or has an unknown key or an impossible value.
    """
    content = read_bytes(path, "a training's config.toml", "check the path", within=within)
    return from_dict(RunConfig, parse_toml(content, path), str(path))
