"""Path lengths over a large floor: between hubs, and from each coarse cell to the nearest ones.

A hub stands in each part of a block of cells that hangs together within the block: one in a block
in the open, one on either side of a wall. Blocks are as large as it takes for the hubs to be few.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, UInt16
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from apollonius.game.chart import NO_PATH

HUBS = 1_600
"""Most hubs."""
NEAREST = 8
"""Hubs to which a cell knows its ways."""
_LEAST_BLOCK = 3
"""Cells along the side of the smallest blocks."""
_REACH = 3.0
"""Length of ways that are looked for from each hub, in sides of a block."""
_TOGETHER = 100
"""Hubs from which ways are looked for at once."""
_Numbers = Int[np.ndarray, " count"]


class _Floor(NamedTuple):
    """Cells that a robot can enter, and the steps between them, a graph whose nodes are these.

    Attributes:
        cells: their numbers.
        row, column: where they are.
        first, last: nodes at the ends of each step.
        length: of each step [m].
    """

    cells: _Numbers
    row: _Numbers
    column: _Numbers
    first: _Numbers
    last: _Numbers
    length: Float[np.ndarray, " steps"]

    def graph(self, is_used: Bool[np.ndarray, " steps"] | None = None) -> csr_array:
        """Return the graph of all steps, or of some."""
        chosen = slice(None) if is_used is None else is_used
        return _graph(len(self.cells), self.first[chosen], self.last[chosen], self.length[chosen])


class _Ways(NamedTuple):
    """Shortest ways from hubs to nodes nearby, and their lengths [m]."""

    hub: _Numbers
    node: _Numbers
    length: Float[np.ndarray, " count"]


def paths_by_hubs(
    is_step: Bool[np.ndarray, "steps rows columns"], steps: Sequence[tuple[int, int]], cell: float
) -> tuple[
    UInt16[np.ndarray, "hubs hubs"],
    UInt16[np.ndarray, "coarse nearest"],
    UInt16[np.ndarray, "coarse nearest"],
]:
    """Return the lengths of paths between hubs [cm], and of each coarse cell the nearest hubs and
    the lengths of the ways there [cm], as in `apollonius.game.chart`.

    Args:
        is_step: whether a robot can enter each cell by each of the steps.
        steps: the steps, in columns and rows.
        cell: the side of a coarse cell [m].
    """
    floor = _floor_of(is_step, steps, cell)
    hubs, block = _place_hubs(floor)
    lengths = np.full((HUBS, HUBS), NO_PATH, np.uint16)
    numbers = np.zeros((is_step[0].size, NEAREST), np.uint16)
    distances = np.full(numbers.shape, NO_PATH, np.uint16)
    if not len(hubs):
        return lengths, numbers, distances
    graph = floor.graph()
    ways, neighbours = _ways_from(floor, graph, hubs, _REACH * block * cell)
    lengths[: len(hubs), : len(hubs)] = _centimetres(dijkstra(neighbours, directed=False))
    order = np.lexsort((ways.length, ways.node))
    node = ways.node[order]
    rank = np.arange(len(node)) - np.searchsorted(node, node)
    is_near = rank < NEAREST
    order, rank = order[is_near], rank[is_near]
    place = floor.cells[ways.node[order]], rank
    numbers[place] = ways.hub[order]
    distances[place] = _centimetres(ways.length[order])
    return lengths, numbers, distances


def _floor_of(
    is_step: Bool[np.ndarray, "steps rows columns"], steps: Sequence[tuple[int, int]], cell: float
) -> _Floor:
    columns = is_step.shape[2]
    firsts = []
    lasts = []
    lengths = []
    for (right, up), is_entered in zip(steps, is_step, strict=True):
        last = np.flatnonzero(is_entered)
        firsts.append(last - up * columns - right)
        lasts.append(last)
        lengths.append(np.full(len(last), cell * np.hypot(right, up)))
    first, last, length = map(np.concatenate, (firsts, lasts, lengths))
    cells, nodes = np.unique(np.concatenate([first, last]), return_inverse=True)
    first, last = np.split(nodes.astype(np.int64), 2)
    row, column = np.divmod(cells, columns)
    return _Floor(cells, row, column, first, last, length)


def _place_hubs(floor: _Floor) -> tuple[_Numbers, int]:
    """Return the nodes of hubs, in the middle of their parts, and the cells along a block."""
    block = _LEAST_BLOCK
    while True:
        row, column = floor.row // block, floor.column // block
        is_inside = (row[floor.first] == row[floor.last]) & (
            column[floor.first] == column[floor.last]
        )
        count, part = connected_components(floor.graph(is_inside), directed=False)
        if count <= HUBS:
            break
        block += 1
    sizes = np.bincount(part, minlength=count)
    middles = [np.bincount(part, place, count) / sizes for place in (floor.row, floor.column)]
    off = np.hypot(floor.row - middles[0][part], floor.column - middles[1][part])
    by_part = np.lexsort((off, part))
    return by_part[np.searchsorted(part[by_part], np.arange(count))], block


def _ways_from(
    floor: _Floor, graph: csr_array, hubs: _Numbers, reach: float
) -> tuple[_Ways, csr_array]:
    """Return the ways from hubs to all nodes within reach [m], and to each node that from the
    nearest one; and the graph of the hubs that these join.
    """
    nearest, _, source = dijkstra(
        graph, directed=False, indices=hubs, min_only=True, return_predecessors=True
    )
    number = np.zeros(len(nearest), np.int64)
    number[hubs] = np.arange(len(hubs))
    owner = number[source]
    ways = [_Ways(owner, np.arange(len(owner)), nearest)]
    for low in range(0, len(hubs), _TOGETHER):
        some = hubs[low : low + _TOGETHER]
        table = dijkstra(graph, directed=False, indices=some, limit=reach)
        hub, node = np.nonzero(np.isfinite(table))
        is_other = owner[node] != hub + low
        hub, node = hub[is_other], node[is_other]
        ways.append(_Ways(hub + low, node, table[hub, node]))
    all_ways = _Ways(*map(np.concatenate, zip(*ways, strict=True)))
    is_hub = np.isin(all_ways.node, hubs) & (all_ways.length > 0)
    meets = np.flatnonzero(owner[floor.first] != owner[floor.last])
    first, last = floor.first[meets], floor.last[meets]
    joined = _graph(
        len(hubs),
        np.concatenate([all_ways.hub[is_hub], owner[first]]),
        np.concatenate([number[all_ways.node[is_hub]], owner[last]]),
        np.concatenate(
            [all_ways.length[is_hub], nearest[first] + floor.length[meets] + nearest[last]]
        ),
    )
    return all_ways, joined


def _graph(
    count: int, first: _Numbers, last: _Numbers, length: Float[np.ndarray, " edges"]
) -> csr_array:
    """Return a graph with the shortest of the edges between two nodes."""
    low, high = np.minimum(first, last), np.maximum(first, last)
    order = np.lexsort((length, high, low))
    low, high, length = low[order], high[order], length[order]
    is_first = np.append(True, (np.diff(low) > 0) | (np.diff(high) > 0))[: len(low)]
    edges = low[is_first], high[is_first]
    return csr_array((length[is_first], edges), shape=(count, count))


def _centimetres(lengths: Float[np.ndarray, "..."]) -> UInt16[np.ndarray, "..."]:
    return np.minimum(np.round(100 * lengths), NO_PATH).astype(np.uint16)
