"""Checkpoints: the training state as one safetensors file, written atomically, read back to the last bit."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from safetensors.numpy import save

from apollonius.arenas.record import from_dict
from apollonius.game.outcome import require_counts
from apollonius.io.arrays import kinds_in, kinds_of, named_leaves, opened, require_finite
from apollonius.io.document import parse_json, to_json, write_atomically
from apollonius.io.errors import InvalidInput, require

FORMAT = "apollonius-checkpoint-2"
T = TypeVar("T")


@dataclass(frozen=True)
class Evaluation:
    """Outcomes of the games of a greedy evaluation."""

    env_steps: int
    episodes: int
    outcomes: dict[str, int]

    def __post_init__(self) -> None:
        for name in ("env_steps", "episodes"):
            value = getattr(self, name)
            require(0 <= value < 2**62, name, value, "0 or more")
        require_counts(self.outcomes, "evaluation")
        require(any(self.outcomes.values()), "outcomes", self.outcomes, "those of one game at least")


@dataclass(frozen=True)
class Standing:
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

    def __post_init__(self) -> None:
        for name in ("chunks", "seconds", "metrics_bytes"):
            value = getattr(self, name)
            require(0 <= value < 2**62, name, value, "0 or more")


def save_checkpoint(path: Path, state: Any, standing: Standing) -> None:
    """Write a pytree of arrays and keys, and how far the run is, so that a crash leaves the old file or the new one.

    Raises:
        OSError: when the disk is full or read-only; the previous checkpoint is untouched.
    """
    arrays = {name: np.asarray(_without_key_type(leaf)) for name, leaf in named_leaves(state).items()}
    write_atomically(path, save(arrays, {FORMAT: to_json(asdict(standing))}))


def load_standing(path: Path) -> Standing:
    """Return how far the run of a checkpoint is.

    Raises:
        InvalidInput: for a missing, truncated or foreign file, and a record that cannot be.
    """
    if not path.is_file():
        raise InvalidInput(f"there is no checkpoint '{path}': the run had not begun; start it with `apollonius train`.")
    with opened(path, "train again", "checkpoint") as file:
        metadata = file.metadata() or {}
    if FORMAT not in metadata:
        raise InvalidInput(f"'{path}' is no checkpoint of this version ({FORMAT}): train again.")
    record = parse_json(metadata[FORMAT], f"'{path}' holds no record of a run: train again")
    return from_dict(Standing, record, f"the record of '{path}'")


def load_checkpoint(path: Path, template: T) -> T:
    """Return the saved pytree, in the structure of `template`, whose values are not used.

    Raises:
        InvalidInput: when the file does not hold this structure, or numbers that are not finite.
    """
    expected = named_leaves(template)
    with opened(path, "train again", "checkpoint") as file:
        if kinds_in(file) != kinds_of({name: _without_key_type(leaf) for name, leaf in expected.items()}):
            raise InvalidInput(f"'{path}' holds another training state than its config.toml describes: train again.")
        saved = {name: file.get_tensor(name) for name in expected}
    require_finite(path, saved, "train again")
    leaves = [_like(leaf, saved[name]) for name, leaf in expected.items()]
    return jax.tree.unflatten(jax.tree.structure(template), leaves)


def _is_key(leaf: Any) -> bool:
    return jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def _without_key_type(leaf: Any) -> Any:
    return jax.random.key_data(leaf) if _is_key(leaf) else leaf


def _like(leaf: Any, saved: Any) -> Any:
    return jax.random.wrap_key_data(jnp.asarray(saved)) if _is_key(leaf) else jnp.asarray(saved)
