"""The folder of a training run: its configuration, its lock, and its checkpoint, read back to the
last bit.
"""

import fcntl
import os
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
import tomli_w
from safetensors.numpy import save

from apollonius.arenas.file import from_dict, to_dict
from apollonius.game.outcome import PURSUER_WINS, names_of, require_counts
from apollonius.io.arrays import named_leaves, open_arrays, read_tree
from apollonius.io.document import parse_json, parse_toml, read_bytes, to_json, write_atomically
from apollonius.io.errors import InvalidInput, require, require_within
from apollonius.learn.config import RunConfig, read_config

FORMAT = "apollonius-checkpoint-2"
METRICS = "metrics.jsonl"
"""Name of the file in a run's folder with its metrics, which is never replaced while it is trained.
"""
_OWN = (
    "agents/*.safetensors",
    "tables/*.safetensors",
    "checkpoint.safetensors",
    "*.jsonl",
    "evaluation.json",
    "state.json",
    "report.html",
    "config.toml",
)
"""A run's own files. The config is the last: until it goes a half-removed folder is still known as
a run's.
"""
T = TypeVar("T")


def create_run(config: RunConfig, folder: Path, force: bool = False) -> None:
    """Make the folder of a new run, with its config; raises InvalidInput for one that holds
    something, but for a run whose own files `force` removes.
    """
    if folder.exists():
        require(folder.is_dir(), "folder", folder, "a folder; choose another")
        if any(folder.iterdir()):
            is_run = (folder / "config.toml").is_file()
            require(
                is_run,
                "folder",
                folder,
                "a run's folder, new or empty, but holds something else; choose another",
            )
            require(
                force,
                "folder",
                folder,
                "a new folder, as this one holds a run; choose another or force it",
            )
            with lock_run(folder):
                for path in (path for pattern in _OWN for path in folder.glob(pattern)):
                    path.unlink()
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / "config.toml", tomli_w.dumps(to_dict(config)).encode())
    (folder / "agents").mkdir(exist_ok=True)


@contextmanager
def lock_run(folder: Path) -> Generator[None, None, None]:
    """Keep other processes from training in a run's folder, if it has locks; raises InvalidInput
    while one does.

    Other machines see a lock on NFS if it is that of a file open for writing, but not that of a
    folder. A link is no such file: what it leads to may be somebody's own.
    """

    def opener(path: str, flags: int) -> int:
        return os.open(path, flags | os.O_NOFOLLOW, 0o666)

    with open(
        folder / METRICS, "a+b", opener=opener
    ) as file:  # with "+" it does not wait for a reader of a pipe
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InvalidInput(
                f"'{folder}' is being trained by another process: wait for it, or stop it."
            ) from error
        except OSError:
            pass  # a file system without locks
        for abandoned in folder.rglob("*.tmp"):  # by a process that was killed
            abandoned.unlink()
        yield


def agent_file(run: Path, name: str, percent: int = 100) -> Path:
    """Return the file of an agent: the one at the end of a run, or that at an earlier percentage of
    self-play.
    """
    return run / "agents" / f"{name}{'' if percent == 100 else f'-{percent}'}.safetensors"


def load_config(path: Path, within: Path | None = None) -> RunConfig:
    """Return the config of a file as `create_run` writes it; what it leaves out has its default.
    Raises InvalidInput for a bad one, and for one that is not `within` a folder, wherever links
    lead.
    """
    content = read_bytes(path, "a training's config.toml", "check the path", within=within)
    return read_config(parse_toml(content, path), str(path))


@dataclass(frozen=True)
class Evaluation:
    """Outcomes of the games of a greedy evaluation."""

    env_steps: int
    episodes: int
    outcomes: dict[str, int]

    def __post_init__(self) -> None:
        require_within(self, 0, 2**62, "env_steps", "episodes")
        require_counts(self.outcomes, "evaluation")
        require(
            any(self.outcomes.values()), "outcomes", self.outcomes, "those of one game at least"
        )

    @property
    def pursuer_win_rate(self) -> float:
        return sum(self.outcomes[name] for name in names_of(PURSUER_WINS)) / sum(
            self.outcomes.values()
        )


@dataclass(frozen=True)
class CheckpointMeta:
    """Metadata of a checkpoint: how far a run is."""

    stage: str
    chunks: int = 0
    """Chunks done of the stage."""
    seconds: float = 0.0
    """Time that they took."""
    best: Evaluation | None = None
    """Evaluation of the best pursuer so far."""
    metrics_bytes: int = 0
    """Size of `metrics.jsonl`."""
    ended: str = ""
    """Digest of the config of a run that has ended, whose checkpoint holds nothing else."""

    def __post_init__(self) -> None:
        require_within(self, 0, 2**62, "chunks", "seconds", "metrics_bytes")


def save_checkpoint(path: Path, state: Any, meta: CheckpointMeta) -> None:
    """Write a pytree of arrays and keys, and how far the run is, so that a crash leaves the old
    file or the new one.
    """
    arrays = {
        name: np.asarray(_without_key_type(leaf)) for name, leaf in named_leaves(state).items()
    }
    write_atomically(path, save(arrays, {FORMAT: to_json(asdict(meta))}))


def end_checkpoint(path: Path, config: RunConfig) -> None:
    """Replace the checkpoint of a run that has ended by a mark: nothing resumes from it."""
    save_checkpoint(path, (), replace(load_checkpoint_meta(path), ended=_digest(config)))


def _digest(config: RunConfig) -> str:
    return sha256(to_json(to_dict(config), sort_keys=True).encode()).hexdigest()


def load_checkpoint_meta(path: Path, config: RunConfig | None = None) -> CheckpointMeta:
    """Read the metadata of a checkpoint: the progress of its run.

    Raises InvalidInput for a missing, damaged or foreign file, and for a checkpoint of another
    training than that of the config.
    """
    with open_arrays(path, "train again", "checkpoint") as file:
        metadata = file.metadata() or {}
    if FORMAT not in metadata:
        raise InvalidInput(f"'{path}' is no checkpoint of this version ({FORMAT}): train again.")
    record = parse_json(metadata[FORMAT], f"'{path}' holds no record of a run: train again")
    meta = from_dict(CheckpointMeta, record, f"the record of '{path}'")
    if config and (meta.stage not in config.by_name or meta.ended not in ("", _digest(config))):
        raise InvalidInput(f"'{path}' is of another training than its config.toml: train again.")
    return meta


def load_checkpoint(path: Path, template: T) -> T:
    """Return the saved pytree; raises InvalidInput unless its arrays are finite, of the template's
    shapes and types.
    """
    misfit = f"'{path}' holds another training state than its config.toml describes: train again."
    with open_arrays(path, "train again", "checkpoint") as file:
        saved = read_tree(
            path, file, jax.tree.map(_without_key_type, template), misfit, "train again"
        )
    return jax.tree.map(
        lambda leaf, new: jax.random.wrap_key_data(new) if _is_key(leaf) else new, template, saved
    )


def _is_key(leaf: Any) -> bool:
    return jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def _without_key_type(leaf: Any) -> Any:
    return jax.random.key_data(leaf) if _is_key(leaf) else leaf
