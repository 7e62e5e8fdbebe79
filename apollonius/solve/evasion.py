"""An evader on a graph that so many pursuers never catch: where it runs while they take away its room."""

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

from apollonius.solve.cop_number import Adjacency, Chase

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
