"""Cops and robbers on a graph: from which states so many pursuers catch an evader for sure, exactly.

All see each other and are equally fast. The pursuers move, each to a neighbour or nowhere, then the evader, and so on;
it is caught where a pursuer is at its node (Nowakowski and Winkler, 1983; Aigner and Fromme, 1984).
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt64
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

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
        return self.caught.ndim - 1

    @property
    def share(self) -> float:
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
    octets = np.packbits(apart, axis=-1, bitorder="little")
    room = [(0, 0)] * (octets.ndim - 1) + [(0, -octets.shape[-1] % 8)]
    return np.pad(octets, room).view(np.uint64)


Team = tuple[int, ...]
"""Nodes of the pursuers."""
State = tuple[Team, int]
"""And of the evader."""


@dataclass(frozen=True)
class Evasion:
    """A run that repeats itself for ever.

    Attributes:
        pursuers: nodes at which they start, and are again after each round; they move first.
        evader: the nodes that it passes in a round, from its start on; from the last it goes to the first.
    """

    pursuers: Team
    evader: tuple[int, ...]


def evade(adjacency: Adjacency, chase: Chase) -> Evasion:
    """Play until a state comes again; whatever the pursuers did instead, the evader would not be caught.

    The nearest pursuer goes the shortest way, and rather on than back; the others leave the evader as few nodes as they
    can which it reaches first (Huang, Zhang, Ding, Stipanović and Tomlin, 2011). The evader goes where it is never
    caught, there where the nearest pursuer is farthest, and rather on than back.

    Args:
        adjacency: the graph.
        chase: the game on it, which these pursuers do not always win.
    """
    apart = np.asarray(shortest_path(csr_array(adjacency.astype(np.int8)), unweighted=True))
    around = [np.unique(row).tolist() for row in chase.near]
    state = before = _start(chase, apart)
    seen: dict[tuple[State, State], int] = {}
    while (before, state) not in seen:
        seen[before, state] = len(seen)
        team, evader = state

        def nearness(moved: Team, before: State = before, evader: int = evader) -> tuple[float, ...]:
            near, first = apart[evader, list(moved)], int(np.argmin(apart[evader, list(moved)]))
            room = float(np.sum(apart[evader] < apart[list(moved)].min(axis=0)))
            return near[first], -apart[before[0][first], moved[first]], room, near.sum()

        moved = min(itertools.product(*(around[node] for node in team)), key=nearness)
        safe = [there for there in around[evader] if not chase.is_caught(moved, there)]
        room = {there: (min(apart[there, list(moved)]), apart[before[1], there]) for there in safe}
        before, state = state, (moved, max(room, key=room.__getitem__))
    passed = [after for _, after in seen][seen[before, state] :]
    # A round begins where the nearest pursuer is farthest.
    begin = max(range(len(passed)), key=lambda number: min(apart[passed[number][1], list(passed[number][0])]))
    passed = passed[begin:] + passed[:begin]
    return Evasion(passed[0][0], tuple(evader for _, evader in passed))


def _start(chase: Chase, apart: Float[np.ndarray, "nodes nodes"]) -> State:
    """All pursuers in one place, and the evader where it is not caught, as far away as it can be."""
    for place in range(len(chase.near)):
        team = (place,) * chase.pursuers
        free = [node for node in range(len(chase.near)) if not chase.is_caught(team, node)]
        if free:
            return team, max(free, key=lambda node: apart[place, node])
    raise AssertionError("pursuers that do not always win have a state from which they do not")
