"""Number of pursuers that is enough in an arena, for idealised robots: equally fast, without
inertia, turn by turn.

The arena is a graph of hexagonal cells, a step leads from one to the next. Three pursuers are
always enough there, as the graph is planar (Aigner and Fromme, 1984), and in the arena itself
(Bhadauria, Klein, Isler and Suri, 2012). Whether one or two are is computed on graphs of growing
fineness, each turned against the one before. All see each other and move in turns; an evader is
caught where a pursuer is at its node (Nowakowski and Winkler, 1983).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_array

from apollonius.arenas.free_space import FreeSpace, Tiling, tile

Adjacency = Bool[np.ndarray, "nodes nodes"]
"""Neighbourhood of the nodes of a graph: symmetric, and no node is its own."""
SIZES = (250, 500, 1000, 2000)
"""Cells that the free space is cut into, if all were whole, until enough graphs in a row agree."""
AGREEING = 3
"""Graphs in a row that must agree: with cells near the lengths that decide, two agree by chance."""
MOST_NODES = 1000
"""Most nodes of a graph's core: two pursuers there take 1 GB and some minutes."""
_TURN = np.pi / 6
"""Cells turned by this are least like those that are not."""
ALWAYS = 3
"""This many are enough in every arena."""


@dataclass(frozen=True)
class GraphResult:
    """A graph, the number of its nodes that matter, and how many pursuers are enough on it.

    `exact` is whether fewer are surely not; `places` those of pursuers who search, from turn to
    turn [m].
    """

    tiling: Tiling
    core: int
    pursuers: int
    exact: bool = True
    places: Float[np.ndarray, "turns pursuers 2"] | None = None


@dataclass(frozen=True)
class CopNumber:
    """The number of pursuers that are enough in an arena, by readings of graphs from coarse to
    fine.
    """

    space: FreeSpace
    graph_results: tuple[GraphResult, ...]

    @property
    def agree(self) -> bool:
        """True where the finest graphs have one verdict."""
        finest = self.graph_results[-AGREEING:]
        return len(finest) == AGREEING and len({reading.pursuers for reading in finest}) == 1

    @property
    def pursuers(self) -> int | None:
        """Number of pursuers that are enough; None where the graphs do not agree."""
        return self.graph_results[-1].pursuers if self.agree else None

    @property
    def verdict(self) -> str:
        """The number of pursuers in words."""
        if self.pursuers is None:
            verdicts = sorted({reading.pursuers for reading in self.graph_results[-AGREEING:]})
            return f"the graphs do not agree or are too few: {' or '.join(map(str, verdicts))}"
        fewer = self.pursuers - 1
        exact = all(reading.exact for reading in self.graph_results[-AGREEING:])
        robots = "for idealised robots on this graph"
        if not fewer:
            return f"1 pursuer is enough, {robots}"
        verb = "is" if fewer == 1 else "are"
        remark = f"{fewer} {verb} not" if exact else f"{fewer} may be"
        return f"{self.pursuers} pursuers are enough, {remark}, {robots}"


def judge_graph(tiling: Tiling) -> GraphResult | None:
    """Find the least number of pursuers that catch an evader on a graph; None where it is too
    large.
    """
    nodes, pursuers = core(tiling.adjacency), 1
    if len(nodes) > MOST_NODES:
        return None
    inner = tiling.adjacency[np.ix_(nodes, nodes)]
    while len(nodes) > 1 and pursuers < ALWAYS and not solve_chase(inner, pursuers).all():
        pursuers += 1
    return GraphResult(tiling, len(nodes), pursuers)


def find_cop_number(
    space: FreeSpace,
    report: Callable[[float], None],
    read: Callable[[Tiling], GraphResult | None] = judge_graph,
    sizes: Sequence[int] = SIZES,
) -> CopNumber:
    """Judge an arena on finer and finer graphs, until three in a row agree or one is too large.

    Args:
        space: the arena's free space.
        report: gets the spacing of each graph [m].
        read: judges one graph; None where it is too large.
        sizes: about the numbers of cells of the graphs.
    """
    readings: list[GraphResult] = []
    for number, size in enumerate(sizes):
        spacing = space.spacing_of(size)
        report(spacing)
        reading = read(tile(space, spacing, (number + 1) % 2 * _TURN))
        if reading is None:
            break
        readings.append(reading)
        result = CopNumber(space, tuple(readings))
        finest = readings[-AGREEING:]
        if result.agree and all(reading.tiling.holes == space.islands for reading in finest):
            break
    return CopNumber(space, tuple(readings))


def core(adjacency: Adjacency) -> Int[np.ndarray, " kept"]:
    """Remove every node whose neighbours are all neighbours of another node; return the others.

    As many pursuers are enough there as on the whole graph (Berarducci and Intrigila, 1993), and
    one is enough where a single node is left (Nowakowski and Winkler, 1983).
    """
    nodes = np.arange(len(adjacency))
    while True:
        near = csr_array(
            (adjacency[np.ix_(nodes, nodes)] | np.eye(len(nodes), dtype=bool)).astype(np.int32)
        )
        sizes = near.sum(axis=1)
        common = near.multiply(near @ near).tocoo()
        node, other = common.coords
        # Of nodes with the same neighbours the first one stays.
        is_covered = (common.data == sizes[node]) & ((sizes[node] < sizes[other]) | (other < node))
        if not is_covered.any():
            return nodes
        nodes = np.delete(nodes, node[is_covered])


def solve_chase(adjacency: Adjacency, pursuers: int) -> Bool[np.ndarray, "evader *pursuers"]:
    """Return for each node of the evader the pursuers' nodes from which they catch it for sure,
    they to move.

    They are enough if that is all states. By backward induction: the least fixed point of
    W(e) = M(at(e) or, for all f near e, W(f)).

    W(e) are the pursuers' nodes from which they catch an evader at e, at(e) those where one is
    there, and M adds those from which the pursuers come there in a move, one pursuer after the
    other. Nodes e are visited until none changes. The graph must be connected. The states take
    nodes ^ (pursuers + 1) bytes.
    """
    count, closed = len(adjacency), adjacency | np.eye(len(adjacency), dtype=bool)
    around = [np.flatnonzero(row) for row in closed]
    longest = max(map(len, around))
    near = np.array([np.pad(nodes, (0, longest - len(nodes)), mode="edge") for nodes in around])
    caught = np.zeros((count,) * (pursuers + 1), bool)
    is_waiting = np.ones(count, bool)
    order = np.arange(count)
    sizes = np.zeros(count, int)
    while is_waiting.any():
        for node in order[is_waiting[order]].tolist():
            is_waiting[node] = False
            after = caught[around[node][0]].copy()
            for other in around[node][1:]:
                after &= caught[other]
            for axis in range(pursuers):
                np.moveaxis(after, axis, 0)[node] = True
            size = np.count_nonzero(after)
            if size > sizes[node]:  # it only grows, so that one of the same size is the same
                sizes[node] = size
                before = _predecessors(after, near) | caught[node]
                if not np.array_equal(before, caught[node]):
                    caught[node] = before
                    is_waiting[around[node]] = True
        order = order[::-1]
    return caught


def _predecessors(
    states: Bool[np.ndarray, "*pursuers"], near: Int[np.ndarray, "nodes most"]
) -> Bool[np.ndarray, "*pursuers"]:
    """Return the states from which the pursuers come to these in a move, each pursuer in its turn
    the first axis.
    """
    for _ in range(states.ndim):
        states_before, buffer = states[near[:, 0]], np.empty_like(states)
        for column in near.T[1:]:
            states_before |= np.take(states, column, axis=0, out=buffer)
        states = np.ascontiguousarray(np.moveaxis(states_before, 0, -1))
    return states
