"""The whole training state as one safetensors file: written atomically, read back to the last bit."""

import json
from pathlib import Path
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from apollonius.agents.store import kinds_of, named_leaves, write_atomically
from apollonius.errors import InvalidInput

FORMAT = "apollonius-checkpoint-1"
T = TypeVar("T")


def save_checkpoint(path: Path, state: Any, progress: dict[str, Any]) -> None:
    """Write a pytree of arrays and keys, and a JSON-like record, so that a crash leaves the old file or the new one.

    Raises:
        OSError: when the disk is full or read-only; the previous checkpoint is untouched.
    """
    arrays = {name: np.asarray(_without_key_type(leaf)) for name, leaf in named_leaves(state).items()}
    write_atomically(path, save(arrays, {FORMAT: json.dumps(progress)}))


def load_progress(path: Path) -> dict[str, Any]:
    """The record saved with a checkpoint.

    Raises:
        InvalidInput: for a missing, truncated or foreign file.
    """
    if not path.is_file():
        raise InvalidInput(f"there is no checkpoint '{path}': the run had not begun; start it with `apollonius train`.")
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = file.metadata() or {}
    except (SafetensorError, OSError) as error:
        raise InvalidInput(f"'{path}' is not a whole checkpoint ({error}): train again.") from error
    if FORMAT not in metadata:
        raise InvalidInput(f"'{path}' is no checkpoint of this version ({FORMAT}): train again.")
    return json.loads(metadata[FORMAT])


def load_checkpoint(path: Path, template: T) -> T:
    """The saved pytree, in the structure of `template`, whose values are not used.

    Raises:
        InvalidInput: when the file does not hold this structure.
    """
    expected = named_leaves(template)
    with safe_open(path, framework="numpy") as file:
        saved = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    if kinds_of(saved) != kinds_of({name: _without_key_type(leaf) for name, leaf in expected.items()}):
        raise InvalidInput(f"'{path}' holds another training state than its config.toml describes: train again.")
    leaves = [_like(leaf, saved[name]) for name, leaf in expected.items()]
    return jax.tree.unflatten(jax.tree.structure(template), leaves)


def _is_key(leaf: Any) -> bool:
    return jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def _without_key_type(leaf: Any) -> Any:
    return jax.random.key_data(leaf) if _is_key(leaf) else leaf


def _like(leaf: Any, saved: Any) -> Any:
    return jax.random.wrap_key_data(jnp.asarray(saved)) if _is_key(leaf) else jnp.asarray(saved)
