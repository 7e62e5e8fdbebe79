"""Arrays by name, as safetensors files hold them: read so that no file can do harm, its header
first.
"""

import os
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import jax
import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from apollonius.io.document import parse_json, to_json, write_atomically
from apollonius.io.errors import InvalidInput, format_value

T = TypeVar("T")
MOST_HEADER = 2**24
"""Largest header of a file [bytes]."""
_NUMBERS = {"BOOL": np.dtype(bool), "U8": np.dtype(np.uint8), "I8": np.dtype(np.int8)} | {
    f"{kind}{8 * size}": np.dtype(f"{kind.lower()}{size}") for kind in "UIF" for size in (2, 4)
}
"""Number types by the names that safetensors has for them."""


@contextmanager
def open_arrays(
    path: Path, remedy: str, kind: str = "safetensors file"
) -> Generator[Any, None, None]:
    """Open a safetensors file and read its header only.

    Raises:
        InvalidInput: If it is missing, cut off, no such `kind` of file, or has a header of more
            than `MOST_HEADER`
            bytes.
    """
    damaged = f"'{path}' is not a whole {kind}"
    if not os.path.isfile(path):  # a pipe would wait for a writer
        raise InvalidInput(f"{damaged} (it is no file): {remedy}.")
    try:
        with open(path, "rb") as file:
            size = int.from_bytes(file.read(8), "little")
        if size > MOST_HEADER:
            raise InvalidInput(f"{damaged} (a header of {size:,} bytes): {remedy}.")
        with safe_open(path, framework="numpy") as file:
            yield file
    except (SafetensorError, OSError) as error:
        raise InvalidInput(f"{damaged} ({error}): {remedy}.") from error


def write_arrays(
    path: Path, arrays: dict[str, np.ndarray], header: Any, form: tuple[str, int]
) -> None:
    """Write a file of arrays and a header atomically.

    Args:
        path: The file.
        arrays: The arrays by name.
        header: A dataclass.
        form: Name and version of the format.
    """
    # One entry: safetensors writes several in an order of their own, and one seed must give one
    # file.
    fields = asdict(header) | {"format": form[0], "version": form[1]}
    write_atomically(path, save(arrays, {"header": to_json(fields, sort_keys=True)}))


def read_header(path: Path, file: Any, form: tuple[str, int], foreign: str) -> dict[str, Any]:
    """Read the header's fields of an open file.

    Args:
        path: The file, for messages.
        file: The open file.
        form: Name and version of its format.
        foreign: Message for a file of another format.

    Raises:
        InvalidInput: For another format or version.
    """
    fields = parse_json((file.metadata() or {}).get("header", ""), foreign)
    if fields.pop("format", None) != form[0]:
        raise InvalidInput(f"{foreign}.")
    version = fields.pop("version", None)
    if version != form[1]:
        remedy = f"this program reads {form[1]}: update it"
        raise InvalidInput(f"'{path}' has format version {format_value(version)}, {remedy}.")
    return fields


def kinds_in(file: Any) -> dict[str, tuple[tuple[int, ...], Any]]:
    """Return the shape and number type of every array of an open file, by its header alone."""
    slices = {name: file.get_slice(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    return {
        name: (tuple(array_slice.get_shape()), _NUMBERS.get(array_slice.get_dtype()))
        for name, array_slice in slices.items()
    }


def read_tree(path: Path, file: Any, template: T, misfit: str, remedy: str) -> T:
    """Read an open file's arrays as a pytree.

    Args:
        path: The file, for messages.
        file: The open file.
        template: A pytree with the names, shapes and number types that the arrays must have.
        misfit: Message for other names, shapes or number types.
        remedy: What to do about numbers that are not finite, for the message.

    Raises:
        InvalidInput: For such arrays.
    """
    leaves = named_leaves(template)
    if kinds_in(file) != {name: (leaf.shape, leaf.dtype) for name, leaf in leaves.items()}:
        raise InvalidInput(misfit)
    arrays = {name: file.get_tensor(name) for name in leaves}
    require_finite(path, arrays, remedy)
    return jax.tree.unflatten(jax.tree.structure(template), jax.device_put(list(arrays.values())))


def require_finite(path: Path, arrays: dict[str, np.ndarray], remedy: str) -> None:
    """Refuse, by InvalidInput, a file whose numbers are not all finite."""
    for name, array in arrays.items():
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise InvalidInput(f"'{path}' has numbers that are not finite, in {name}: {remedy}.")


def named_leaves(tree: Any) -> dict[str, Any]:
    """Return the arrays of a pytree by their paths, as `layers/0/weight`, in the tree's order."""
    leaves = jax.tree_util.tree_flatten_with_path(tree)[0]
    return {jax.tree_util.keystr(path, simple=True, separator="/"): leaf for path, leaf in leaves}
