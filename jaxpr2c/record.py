"""Layout in memory of the arguments and results of a program."""

import itertools
import re
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np

from jaxpr2c.errors import require
from jaxpr2c.names import is_taken
from jaxpr2c.scalars import TYPES


@dataclass(frozen=True)
class Leaf:
    """An array of an argument or of the result: its name by its place in the pytree, its NumPy
    type, its shape.
    """

    name: str
    kind: str
    shape: tuple[int, ...]
    place: int = 0

    @property
    def size(self) -> int:
        return int(np.prod(self.shape, dtype=int))


@dataclass(frozen=True)
class Record:
    """An argument, or the result, as one block of memory: its leaves in order, each aligned to its
    kind, as C does.

    A lone array is one leaf without a name.
    """

    name: str
    leaves: tuple[Leaf, ...]

    @property
    def is_array(self) -> bool:
        """Check whether it is an array and no pytree."""
        return len(self.leaves) == 1 and not self.leaves[0].name

    @property
    def layout(self) -> np.dtype[Any]:
        """Return the block's type, with a field for each leaf by its place."""
        formats = [(leaf.kind, leaf.shape) for leaf in self.leaves]
        return np.dtype(
            {"names": [str(leaf.place) for leaf in self.leaves], "formats": formats}, align=True
        )

    @property
    def offsets(self) -> tuple[int, ...]:
        """List the offsets at which the leaves begin [bytes]."""
        return tuple(int(offset) for _, offset, *_ in (self.layout.fields or {}).values())

    def text(self, leaf: Leaf) -> str:
        """Return the C expression of a leaf."""
        return self.name if self.is_array else f"{self.name}->{leaf.name}"

    def only(self, texts: Collection[str]) -> "Record":
        """Return the record of the leaves that are written so in C."""
        return Record(self.name, tuple(leaf for leaf in self.leaves if self.text(leaf) in texts))

    def pack(self, tree: Any) -> bytes:
        """Return the block of memory that holds what a program reads of a pytree."""
        block, values = np.zeros((), self.layout), jax.tree.leaves(tree)
        for leaf in self.leaves:
            block[str(leaf.place)] = np.asarray(values[leaf.place])
        return block.tobytes()

    def unpack(self, block: bytes) -> list[np.ndarray]:
        """Return the arrays that a block of memory holds."""
        fields = np.frombuffer(block, self.layout, 1)[0]
        return [np.array(fields[str(leaf.place)]) for leaf in self.leaves]


def record_of(name: str, tree: Any) -> Record:
    """Return the record of a pytree of arrays; its leaves are called after their places in it.

    Raises Unsupported for numbers of a kind that C lacks, and for an array without elements.
    """
    leaves = dict[str, Leaf]()
    for place, (path, leaf) in enumerate(jax.tree_util.tree_flatten_with_path(tree)[0]):
        words = "_".join(re.findall("[A-Za-z0-9]+", jax.tree_util.keystr(path))).lower()
        words = words if words[:1].isalpha() or not path else f"value_{words}".rstrip("_")
        words = f"{words}_" if is_taken(words) else words
        alternatives = (f"{words}_{number}" for number in itertools.count(2))
        unique = next(word for word in itertools.chain([words], alternatives) if word not in leaves)
        kind, shape = str(_kind(leaf)), tuple(np.shape(leaf))
        require(
            kind in TYPES, f"the kind of {name}", kind, f"one of {', '.join(TYPES)}: convert it"
        )
        require(
            0 not in shape,
            f"the shape of {name}",
            shape,
            "of at least one element: leave the array out",
        )
        leaves[unique] = Leaf(unique, kind, shape, place)
    return Record(name, tuple(leaves.values()))


def _kind(leaf: Any) -> Any:
    """Return the type that JAX computes with for a number or an array."""
    kind = getattr(leaf, "dtype", None) or jax.numpy.result_type(leaf)
    return jax.dtypes.canonicalize_dtype(kind) if isinstance(kind, np.dtype) else kind
