"""How many searchers are enough, beside all states examined plainly, and evaders that know the strategy."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from apollonius.arenas.free_space import free_space
from apollonius.game.presets import make_game
from apollonius.game.sensing import Sensing, Sensors
from apollonius.solve import searchers
from apollonius.solve.searchers import clearing, how_many_to_see
from tests.solve.test_cop_number import cycle, path


def is_cleared_plainly(adjacency, seen, pursuers):
    """Return whether some walk of the searchers leaves no node for an evader, by all states."""
    near = [np.flatnonzero(row) for row in adjacency | np.eye(len(adjacency), dtype=bool)]
    nodes = range(len(adjacency))

    def left(team, could):
        return frozenset(node for node in could if not any(seen[at, node] for at in team))

    known = {(team, left(team, nodes)) for team in itertools.product(nodes, repeat=pursuers)}
    fresh = known
    while fresh:
        if any(not could for _, could in fresh):
            return True
        fresh = {
            (team, left(team, {int(to) for node in could for to in near[node]}))
            for at, could in fresh
            for team in itertools.product(*(near[node].tolist() for node in at))
        } - known
        known = known | fresh
    return False


def escapes(adjacency, seen, found):
    """Return whether an evader that knows a strategy is never seen, each step of which is checked."""
    near = adjacency | np.eye(len(adjacency), dtype=bool)
    could = {node for node in range(len(near)) if not any(seen[at, node] for at in found[0])}
    for before, after in itertools.pairwise(found):
        reached = any(
            all(near[one, to] for one, to in zip(before, other, strict=True)) for other in itertools.permutations(after)
        )
        assert reached, "a searcher moves to a neighbour or nowhere"
        could = {to for node in could for to in np.flatnonzero(near[node]).tolist()}
        could = {node for node in could if not any(seen[at, node] for at in after)}
    return bool(could)


@pytest.mark.parametrize("seed", range(12))
def test_searching_random_graphs(seed):
    random = np.random.default_rng(seed)
    adjacency = np.triu(random.random((5, 5)) < 0.4, 1) | np.eye(5, k=1, dtype=bool)
    adjacency |= adjacency.T
    seen = np.triu(random.random((5, 5)) < 0.3, 1) | np.eye(5, dtype=bool)
    seen |= seen.T | (adjacency & (random.random() < 0.5))
    for pursuers in (1, 2):
        found, all_examined = clearing(adjacency, seen, pursuers, 6)
        possible = is_cleared_plainly(adjacency, seen, pursuers)
        if found:
            assert possible
            assert not escapes(adjacency, seen, found)
        elif all_examined or pursuers == 1:
            assert not possible
            assert all_examined


@pytest.mark.parametrize(("adjacency", "known"), [(path(9), 1), (cycle(9), 2)], ids=["path", "cycle"])
def test_who_sees_the_next_nodes_clears_a_path_alone_and_a_cycle_with_a_second(adjacency, known):
    seen = adjacency | np.eye(len(adjacency), dtype=bool)
    assert [bool(clearing(adjacency, seen, pursuers, 6)[0]) for pursuers in (1, 2)] == [known == 1, True]
    assert clearing(adjacency, seen, 1, 6)[1] == (known == 2)
    assert clearing(adjacency, seen, 2, 6, most=1) == ([], False)


def test_sensors_of_a_game_count(monkeypatch):
    monkeypatch.setattr(searchers, "SIZES", (40, 60, 80))
    game, far = make_game("one-large"), Sensors(line_of_sight=True, field_of_view=0.1)
    space = free_space(game)
    found, spacings = how_many_to_see(game, space, (told := []).append), set(told)
    assert found.pursuers == 2
    assert "2 pursuers are enough, 1 is not" in found.verdict
    assert {reading.tiling.spacing for reading in found.readings} == spacings
    monkeypatch.setattr(searchers, "SIZES", (40,))
    for sensors, known in ((far, 2), (Sensors(range=30.0), 1), (Sensors(range=3.0), 2)):
        one = how_many_to_see(replace(game, sensors=Sensing(sensors)), space, told.append).readings[0]
        assert one.pursuers == known


def test_where_no_strategy_is_found_nothing_is_said(monkeypatch):
    monkeypatch.setattr(searchers, "MOST_SEARCHERS", 1)
    game = make_game("one-large")
    assert how_many_to_see(game, free_space(game), lambda spacing: None).readings == ()
