"""How the arguments and results of a program lie in memory."""

import re
from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
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
    """An array of an argument or of the result.

    Attributes:
        name: an identifier, from its place in the pytree.
        kind: the name of its NumPy type.
        shape: its shape, `()` for a scalar.
        offset: where it begins in its record [bytes].
        place: which of the pytree's leaves it is.
    """

    name: str
    kind: str
    shape: tuple[int, ...]
    offset: int = 0
    place: int = 0

    @property
    def size(self) -> int:
        """Return the number of elements."""
        return int(np.prod(self.shape, dtype=int))


@dataclass(frozen=True)
class Record:
    """An argument, or the result, as one block of memory: its leaves in order, each aligned to its kind, as C does.

    Attributes:
        name: what the program calls it.
        leaves: the arrays in it; of a lone array one without a name.
    """

    name: str
    leaves: tuple[Leaf, ...]

    @property
    def lone(self) -> bool:
        """Return whether it is an array and no pytree."""
        return len(self.leaves) == 1 and not self.leaves[0].name

    @property
    def length(self) -> int:
        """Return its length [bytes], a multiple of its widest alignment."""
        widest = max((np.dtype(leaf.kind).itemsize for leaf in self.leaves), default=1)
        last = self.leaves[-1] if self.leaves else None
        end = last.offset + last.size * np.dtype(last.kind).itemsize if last else 0
        return end + -end % widest

    @classmethod
    def of(cls, name: str, leaves: Iterable[Leaf]) -> "Record":
        """Return the record of leaves, whose offsets follow from those before them."""
        placed, end = [], 0
        for leaf in leaves:
            width = np.dtype(leaf.kind).itemsize
            start = end + -end % width
            placed.append(replace(leaf, offset=start))
            end = start + leaf.size * width
        return cls(name, tuple(placed))

    def text(self, leaf: Leaf) -> str:
        """Return how a leaf is written in C."""
        return self.name if self.lone else f"{self.name}->{leaf.name}"

    def only(self, texts: Collection[str]) -> "Record":
        """Return the record of the leaves that are written so in C."""
        return Record.of(self.name, [leaf for leaf in self.leaves if self.text(leaf) in texts])

    def pack(self, tree: Any) -> bytes:
        """Return the block of memory that holds what a program reads of a pytree."""
        block, values = bytearray(self.length), jax.tree.leaves(tree)
        for leaf in self.leaves:
            content = np.ascontiguousarray(np.asarray(values[leaf.place]), leaf.kind).tobytes()
            block[leaf.offset : leaf.offset + len(content)] = content
        return bytes(block)

    def unpack(self, block: bytes) -> list[np.ndarray]:
        """Return the arrays that a block of memory holds."""
        return [
            np.frombuffer(block, leaf.kind, leaf.size, leaf.offset).reshape(leaf.shape).copy() for leaf in self.leaves
        ]


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
    return Record.of(_named(name), leaves)


def _named(word: str) -> str:
    return f"{word}_" if _KEYWORDS.fullmatch(word) else word
