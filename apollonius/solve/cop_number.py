"""Cops and robbers on a graph: the states from which some pursuers catch an evader for sure, exactly.

All see each other and are equally fast. The pursuers move, each to a neighbour or nowhere, then the evader, and so on;
it is caught where a pursuer is at its node (Nowakowski and Winkler, 1983; Aigner and Fromme, 1984).
"""

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

Adjacency = Bool[np.ndarray, "nodes nodes"]
"""Which nodes of a graph are neighbours: symmetric, and no node is its own."""
Teams = Bool[np.ndarray, "*pursuers"]
"""Some of all states of the pursuers."""
Team = tuple[int, ...]
"""Nodes of the pursuers."""
State = tuple[Team, int]
"""Nodes of the pursuers and of the evader."""


@dataclass(frozen=True)
class Chase:
    """The game of some pursuers on a connected graph, solved.

    Attributes:
        around: of each node, its neighbours and itself.
        caught: for each node of the evader the pursuers' nodes from which they catch it for sure, they to move.
    """

    around: tuple[Int[np.ndarray, " _"], ...]
    caught: Bool[np.ndarray, "evader *pursuers"]

    @property
    def pursuers(self) -> int:
        return self.caught.ndim - 1

    @property
    def always(self) -> bool:
        """True where these pursuers are enough: from all states, or from none in which they start together."""
        return bool(self.caught.all())


def core(adjacency: Adjacency) -> Int[np.ndarray, " kept"]:
    """Return the nodes that are left when each goes whose neighbours are neighbours of another one too.

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


def solve_chase(adjacency: Adjacency, pursuers: int) -> Chase:
    """Solve the game by backward induction: the least fixed point of W(e) = M(at(e) or, for all f near e, W(f)).

    W(e) are the pursuers' nodes from which they catch an evader at e, at(e) those where one is there, and M adds those
    from which the pursuers come there in a move, one pursuer after the other. Nodes e are visited until none changes.

    Args:
        adjacency: a connected graph.
        pursuers: how many, 1 or more. The states take nodes ^ (pursuers + 1) bytes.
    """
    count, own = len(adjacency), adjacency | np.eye(len(adjacency), dtype=bool)
    around = tuple(np.flatnonzero(row) for row in own)
    most = max(map(len, around))
    near = np.array([np.pad(nodes, (0, most - len(nodes)), mode="edge") for nodes in around])
    caught = np.zeros((count,) * (pursuers + 1), bool)
    waits, order, known = np.ones(count, bool), np.arange(count), np.zeros(count, int)
    while waits.any():
        for node in order[waits[order]].tolist():
            waits[node] = False
            after = caught[around[node][0]].copy()
            for other in around[node][1:]:
                after &= caught[other]
            for axis in range(pursuers):
                np.moveaxis(after, axis, 0)[node] = True
            size = np.count_nonzero(after)
            if size > known[node]:  # it only grows, so that one of the same size is the same
                known[node] = size
                before = _before(after, near) | caught[node]
                if not np.array_equal(before, caught[node]):
                    caught[node] = before
                    waits[around[node]] = True
        order = order[::-1]
    return Chase(around, caught)


def _before(
    states: Bool[np.ndarray, "*pursuers"], near: Int[np.ndarray, "nodes most"]
) -> Bool[np.ndarray, "*pursuers"]:
    """Return the states from which the pursuers come to these in a move, each pursuer in its turn the first axis."""
    for _ in range(states.ndim):
        reached, there = states[near[:, 0]], np.empty_like(states)
        for column in near.T[1:]:
            reached |= np.take(states, column, axis=0, out=there)
        states = np.ascontiguousarray(np.moveaxis(reached, 0, -1))
    return states


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
    state = before = _start(chase, apart)
    seen: dict[tuple[State, State], int] = {}
    while (before, state) not in seen:
        seen[before, state] = len(seen)
        team, evader = state

        def nearness(moved: Team, before: State = before, evader: int = evader) -> tuple[float, ...]:
            near, first = apart[evader, list(moved)], int(np.argmin(apart[evader, list(moved)]))
            reach = float(np.sum(apart[evader] < apart[list(moved)].min(axis=0)))
            return near[first], -apart[before[0][first], moved[first]], reach, near.sum()

        moved = min(itertools.product(*(chase.around[node].tolist() for node in team)), key=nearness)
        safe = [there for there in chase.around[evader].tolist() if not chase.caught[(there, *moved)]]
        reach = {there: (min(apart[there, list(moved)]), apart[before[1], there]) for there in safe}
        before, state = state, (moved, max(reach, key=reach.__getitem__))
    passed = [after for _, after in seen][seen[before, state] :]
    # A round begins where the nearest pursuer is farthest.
    begin = max(range(len(passed)), key=lambda number: min(apart[passed[number][1], list(passed[number][0])]))
    passed = passed[begin:] + passed[:begin]
    return Evasion(passed[0][0], tuple(evader for _, evader in passed))


def _start(chase: Chase, apart: Float[np.ndarray, "nodes nodes"]) -> State:
    """Return all pursuers at one node, and the evader where it is not caught, as far away as it can be."""
    for node in range(len(chase.around)):
        team = (node,) * chase.pursuers
        free = np.flatnonzero(~chase.caught[(slice(None), *team)])
        if len(free):
            return team, int(free[np.argmax(apart[node, free])])
    raise AssertionError("pursuers that do not always win have a state from which they do not")
