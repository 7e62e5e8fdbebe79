"""How the arguments and results of a program lie in memory."""

import re
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np

_KEYWORDS = re.compile(
    "auto|break|case|char|const|continue|default|do|double|else|enum|extern|float|for|goto|if|inline|int|long|register|"
    "restrict|return|short|signed|sizeof|static|struct|switch|typedef|union|unsigned|void|volatile|while"
)
"""Words that no name in C can be."""


@dataclass(frozen=True)
class Leaf:
    """An array of an argument or of the result: its name by its place in the pytree, its NumPy type, its shape."""

    name: str
    kind: str
    shape: tuple[int, ...]
    place: int = 0

    @property
    def size(self) -> int:
        return int(np.prod(self.shape, dtype=int))


@dataclass(frozen=True)
class Record:
    """An argument, or the result, as one block of memory: its leaves in order, each aligned to its kind, as C does.

    A lone array is one leaf without a name.
    """

    name: str
    leaves: tuple[Leaf, ...]

    @property
    def lone(self) -> bool:
        """Return whether it is an array and no pytree."""
        return len(self.leaves) == 1 and not self.leaves[0].name

    @property
    def layout(self) -> np.dtype[Any]:
        """Return the block's type, with a field for each leaf by its place."""
        formats = [(leaf.kind, leaf.shape) for leaf in self.leaves]
        return np.dtype({"names": [str(leaf.place) for leaf in self.leaves], "formats": formats}, align=True)

    @property
    def offsets(self) -> tuple[int, ...]:
        """Return where each leaf begins [bytes]."""
        return tuple(int(offset) for _, offset, *_ in (self.layout.fields or {}).values())

    def text(self, leaf: Leaf) -> str:
        """Return how a leaf is written in C."""
        return self.name if self.lone else f"{self.name}->{leaf.name}"

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
    """Return the record of a pytree of arrays; its leaves are called after their places in it."""
    found, leaves = Counter[str](), list[Leaf]()
    for path, leaf in jax.tree_util.tree_flatten_with_path(tree)[0]:
        words = "_".join(re.findall(r"[^\W_]+", jax.tree_util.keystr(path))).lower()
        called = _named(f"value_{words}" if words[:1].isdigit() else words)
        found[called] += 1
        kind = str(jax.dtypes.canonicalize_dtype(jax.numpy.result_type(leaf)))
        unique = called if found[called] == 1 else f"{called}_{found[called]}"
        leaves.append(Leaf(unique, kind, tuple(np.shape(leaf)), place=len(leaves)))
    return Record(_named(name), tuple(leaves))


def _named(word: str) -> str:
    return f"{word}_" if _KEYWORDS.fullmatch(word) else word
