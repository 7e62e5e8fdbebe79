"""An evader that is never caught: its run is one that it can run, and goes on for ever."""

import numpy as np
import pytest

from apollonius.solve.cop_number import solve_chase
from apollonius.solve.evasion import evade
from tests.solve.test_cop_number import cycle, dodecahedron, graph, petersen


@pytest.mark.parametrize(
    ("adjacency", "pursuers"), [(cycle(9), 1), (petersen(), 2), (dodecahedron(), 2)], ids=["cycle", "Petersen", "dode"]
)
def test_the_run_leads_from_neighbour_to_neighbour_and_back(adjacency, pursuers):
    chase = solve_chase(adjacency, pursuers)
    found = evade(adjacency, chase)
    beside = adjacency | np.eye(len(adjacency), dtype=bool)
    assert beside[found.evader, np.roll(found.evader, -1)].all()
    assert len(found.pursuers) == pursuers
    assert not chase.is_caught(found.pursuers, found.evader[0])


def test_chased_by_one_it_runs_all_round_a_cycle():
    found = evade(cycle(9), solve_chase(cycle(9), 1))
    assert sorted(found.evader) == list(range(9))


def test_it_does_not_run_into_a_dead_end():
    links = [(0, 9), *((i, i + 1) for i in range(4)), *((i, i + 1) for i in range(5, 12)), (12, 5)]
    adjacency = graph(13, links)
    found = evade(adjacency, solve_chase(adjacency, 1))
    assert set(found.evader) == set(range(5, 13))
