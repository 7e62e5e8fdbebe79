"""Cops and robbers on a graph: from which states so many pursuers catch an evader for sure, exactly.

All see each other and are equally fast. The pursuers move, each to a neighbour or nowhere, then the evader, and so on;
it is caught where a pursuer is at its node (Nowakowski and Winkler, 1983; Aigner and Fromme, 1984).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int, UInt64
from scipy.sparse import csr_array

Adjacency = Bool[np.ndarray, "nodes nodes"]
"""Which nodes of a graph are neighbours: symmetric, and no node is its own."""
Near = Int[np.ndarray, "nodes most"]
"""The neighbours of each node and itself, which is repeated so that all rows are equally long."""
States = UInt64[np.ndarray, "*others words"]
"""A bit for where each pursuer is; those of the last one are packed, 64 in a word, the first in the lowest bit."""


@dataclass(frozen=True)
class Chase:
    """The game of some pursuers on a connected graph, solved.

    Attributes:
        near: the graph.
        caught: for each node of the evader the pursuers' nodes from which they catch it for sure, they to move.
    """

    near: Near
    caught: UInt64[np.ndarray, "evader *others words"]

    @property
    def pursuers(self) -> int:
        """How many there are."""
        return self.caught.ndim - 1

    @property
    def share(self) -> float:
        """Share of all states from which the evader is caught."""
        return _share(self.caught, len(self.near))

    @property
    def always(self) -> bool:
        """Whether these pursuers are enough: if they are from one place, whatever the evader's, then from all."""
        return self.share == 1.0

    def is_caught(self, pursuers: tuple[int, ...], evader: int) -> bool:
        """Whether the evader is caught for sure, the pursuers to move, with all at these nodes."""
        *others, last = pursuers
        return bool(self.caught[(evader, *others)].view(np.uint8)[last // 8] >> (last % 8) & 1)


def silent(share: float) -> None:
    """Tells nobody."""


def core(adjacency: Adjacency) -> Int[np.ndarray, " kept"]:
    """The nodes that are left when none is kept whose neighbours are neighbours of another one too.

    As many pursuers are enough there as on the whole graph (Berarducci and Intrigila, 1993), and one is enough where a
    single node is left (Nowakowski and Winkler, 1983).
    """
    kept = np.arange(len(adjacency))
    while True:
        near = csr_array((adjacency[np.ix_(kept, kept)] | np.eye(len(kept), dtype=bool)).astype(np.int32))
        sizes = near.sum(axis=1)
        common = near.multiply(near @ near).tocoo()
        node, other = common.coords
        # Of nodes with the same neighbours the first one stays.
        covered = (common.data == sizes[node]) & ((sizes[node] < sizes[other]) | (other < node))
        if not covered.any():
            return kept
        kept = np.delete(kept, node[covered])


def solve_chase(adjacency: Adjacency, pursuers: int, report: Callable[[float], None] = silent) -> Chase:
    """Solve the game by backward induction: the least fixed point of W(e) = M(at(e) or, for all f near e, W(f)).

    W(e) are the pursuers' nodes from which they catch an evader at e, at(e) those where one is there, and M adds those
    from which the pursuers come there in a move, one pursuer after the other. Nodes e are visited until none changes.

    Args:
        adjacency: a connected graph.
        pursuers: how many, 1 or more. The states take (nodes ^ (pursuers + 1)) / 8 bytes.
        report: told now and then from which share of all states the evader is known to be caught.
    """
    count, near = len(adjacency), _near(adjacency)
    around = [np.unique(row) for row in near]
    caught = np.zeros((count,) * pursuers + (-(-count // 64),), np.uint64)
    for node in range(count):
        _set_reached(caught[node], node, count)
    waits, order = np.ones(count, bool), np.arange(count)
    while waits.any():
        for node in order[waits[order]].tolist():
            waits[node] = False
            after = np.bitwise_and.reduce(caught[around[node]], axis=0)
            _set_reached(after, node, count)
            before = _before(after, near) | caught[node]
            if not np.array_equal(before, caught[node]):
                caught[node] = before
                waits[around[node]] = True
        order = order[::-1]
        report(_share(caught, count))
    return Chase(near, caught)


def _near(adjacency: Adjacency) -> Near:
    """A graph as lists of neighbours."""
    own = adjacency | np.eye(len(adjacency), dtype=bool)
    first = np.argsort(~own, axis=1, kind="stable")[:, : own.sum(axis=1).max()]
    return np.where(np.take_along_axis(own, first, axis=1), first, np.arange(len(own))[:, None])


def _share(caught: UInt64[np.ndarray, "evader *others words"], count: int) -> float:
    """Of all states; no bit of a word that stands for no node is ever set."""
    return int(np.bitwise_count(caught).sum(dtype=np.int64)) / count ** (caught.ndim)


def _set_reached(states: States, node: int, count: int) -> None:
    """Add those in which a pursuer is at this node."""
    everywhere = np.packbits(np.arange(64 * states.shape[-1]) < count, bitorder="little").view(np.uint64)
    for axis in range(states.ndim - 1):
        np.moveaxis(states, axis, 0)[node] = everywhere
    states[..., node // 64] |= np.uint64(1) << np.uint64(node % 64)


def _before(states: States, near: Near) -> States:
    """Whence the pursuers come to some states in a move; the states are the same when two pursuers change places."""
    for axis in range(states.ndim - 1):
        states = _reaching(states, near, axis)
    # Bits are as slow as bytes along their own axis: the last pursuer changes places with the first, and moves there.
    apart = np.unpackbits(states.view(np.uint8), axis=-1, count=len(near), bitorder="little")
    if states.ndim == 1:
        return _packed(_reaching(apart, near, 0))
    return _reaching(_packed(np.ascontiguousarray(np.swapaxes(apart, 0, -1))), near, 0)


def _reaching(states: np.ndarray, near: Near, axis: int) -> np.ndarray:
    """States with those from which the pursuer of this axis comes there in a move."""
    out = np.take(states, near[:, 0], axis=axis)
    for column in near.T[1:]:
        out |= np.take(states, column, axis=axis)
    return out


def _packed(apart: np.ndarray) -> States:
    """States from one byte for each."""
    octets = np.packbits(apart, axis=-1, bitorder="little")
    room = [(0, 0)] * (octets.ndim - 1) + [(0, -octets.shape[-1] % 8)]
    return np.pad(octets, room).view(np.uint64)
