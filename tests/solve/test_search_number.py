"""How many pursuers and searchers are enough, beside known graphs and arenas, and all states examined plainly."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from apollonius.arenas.free_space import free_space, largest_part
from apollonius.game.presets import make_game
from apollonius.game.sensing import Sensing, Sensors
from apollonius.solve import cop_number, search_number
from apollonius.solve.cop_number import core, solve_chase
from apollonius.solve.search_number import clearing_strategy, find_search_number
from tests.arenas.test_free_space import ANNULUS, BENT, ROOM


def graph(count, links):
    adjacency = np.zeros((count, count), bool)
    adjacency[tuple(np.transpose(links))] = True
    return adjacency | adjacency.T


def path(count):
    return graph(count, [(i, i + 1) for i in range(count - 1)])


def cycle(count):
    return graph(count, [(i, (i + 1) % count) for i in range(count)])


def petersen():
    return graph(10, [link for i in range(5) for link in ((i, (i + 1) % 5), (i, i + 5), (i + 5, (i + 2) % 5 + 5))])


def plainly_caught(adjacency, pursuers):
    """States from which the evader is caught, by the definition: who moves there is told by the last entry."""
    nodes = range(len(adjacency))
    near = [[j for j in nodes if i == j or adjacency[i, j]] for i in nodes]
    teams = list(itertools.product(nodes, repeat=pursuers))
    won = {(team, e, turn) for team in teams for e in nodes for turn in (0, 1) if e in team}
    while True:
        new = set()
        for team, e in itertools.product(teams, nodes):
            if any((there, e, 1) in won for there in itertools.product(*(near[p] for p in team))):
                new.add((team, e, 0))
            if all((team, there, 0) in won for there in near[e]):
                new.add((team, e, 1))
        if new <= won:
            return won
        won |= new


def chords(seed):
    """A cycle of nine and some links across it."""
    ends = np.random.default_rng(seed).integers(9, size=(3, 2))
    return cycle(9) | graph(9, [(i, j) for i, j in ends if i != j])


MIXED = np.array([[4, 0, 7, 2, 8, 5, 1, 6, 3]])


GRAPHS = {
    "point": (np.zeros((1, 1), bool), 1),
    "triangle": (cycle(3), 1),
    "chords": (chords(0), 1),
    "other chords": (chords(1), 1),
    "two among chords": (chords(2), 2),
    "one on Petersen": (petersen(), 1),
    "two on Petersen": (petersen(), 2),
    "on a path, out of order": (path(9)[MIXED, MIXED.T], 1),
}


@pytest.mark.parametrize("name", GRAPHS)
def test_solve_chase_matches_a_plain_search_and_the_core(name):
    adjacency, pursuers = GRAPHS[name]
    won, caught = plainly_caught(adjacency, pursuers), solve_chase(adjacency, pursuers)
    for evader, *team in np.ndindex(caught.shape):
        assert caught[(evader, *team)] == ((tuple(team), evader, 0) in won)
    kept = core(adjacency)
    assert solve_chase(adjacency[np.ix_(kept, kept)], pursuers).all() == caught.all()
    assert (len(kept) == 1) == solve_chase(adjacency, 1).all()


SMALL = ROOM.copy()
SMALL[50:62, 50:62] = False
"""An island that large cells do not see."""


def count(free, sizes, report=lambda spacing: None):
    return cop_number.find_cop_number(largest_part(free, 0.0, 0.0, 0.1), report, sizes=sizes)


@pytest.mark.parametrize(
    ("free", "sizes", "pursuers", "islands", "said"),
    [
        (ROOM, (60, 100, 150), [1, 1, 1], [0, 0, 0], "1 pursuer is enough"),
        (BENT, (60, 100, 150), [1, 1, 1], [0, 0, 0], "1 pursuer is enough"),
        (SMALL, (12, 200, 300), [1, 2, 2], [0, 1, 1], "the graphs do not agree"),
        (ANNULUS, (60, 100), [2, 2], [1, 1], "the graphs do not agree or are too few"),
        (SMALL, (12, 200, 300, 400), [1, 2, 2, 2], [0, 1, 1, 1], "2 pursuers are enough, 1 is not"),
        (ANNULUS, (60, 100, 150, 200), [2, 2, 2], [1, 1, 1], "2 pursuers are enough, 1 is not"),
    ],
    ids=["room", "bent room", "disagree", "two", "go on", "annulus"],
)
def test_verdict_needs_three_agreeing_graphs_that_see_every_island(free, sizes, pursuers, islands, said):
    found = count(free, sizes, (told := []).append)
    assert told == [reading.tiling.spacing for reading in found.graph_results]
    assert [reading.pursuers for reading in found.graph_results] == pursuers
    assert [reading.tiling.holes for reading in found.graph_results] == islands
    assert found.verdict.startswith(said)
    assert found.agree == ("enough" in said)
    assert found.pursuers == (pursuers[-1] if found.agree else None)


def test_graphs_with_too_many_nodes_are_omitted(monkeypatch):
    monkeypatch.setattr(cop_number, "MOST_NODES", 20)
    found = count(ANNULUS, (60, 600))
    assert len(found.graph_results) == 1
    assert found.pursuers is None


def is_cleared_plainly(adjacency, seen, pursuers):
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
def test_clearing_strategy_matches_a_plain_search_on_random_graphs(seed):
    random = np.random.default_rng(seed)
    adjacency = np.triu(random.random((5, 5)) < 0.4, 1) | np.eye(5, k=1, dtype=bool)
    adjacency |= adjacency.T
    seen = np.triu(random.random((5, 5)) < 0.3, 1) | np.eye(5, dtype=bool)
    seen |= seen.T | (adjacency & (random.random() < 0.5))
    for pursuers in (1, 2):
        found, all_examined = clearing_strategy(adjacency, seen, pursuers, 6)
        possible = is_cleared_plainly(adjacency, seen, pursuers)
        if found:
            assert possible
            assert not escapes(adjacency, seen, found)
        elif all_examined or pursuers == 1:
            assert not possible
            assert all_examined


@pytest.mark.parametrize(("adjacency", "known"), [(path(9), 1), (cycle(9), 2)], ids=["path", "cycle"])
def test_one_searcher_clears_a_path_and_two_clear_a_cycle(adjacency, known):
    seen = adjacency | np.eye(len(adjacency), dtype=bool)
    assert [bool(clearing_strategy(adjacency, seen, pursuers, 6)[0]) for pursuers in (1, 2)] == [known == 1, True]
    assert clearing_strategy(adjacency, seen, 1, 6)[1] == (known == 2)
    assert clearing_strategy(adjacency, seen, 2, 6, most_states=1) == ([], False)


def test_search_number_depends_on_the_sensors(monkeypatch):
    monkeypatch.setattr(search_number, "SIZES", (40, 60, 80))
    game, far = make_game("one-large"), Sensors(line_of_sight=True, field_of_view=0.1)
    space = free_space(game)
    found, spacings = find_search_number(game, space, (told := []).append), set(told)
    assert found.pursuers == 2
    assert "2 pursuers are enough, 1 is not" in found.verdict
    assert {reading.tiling.spacing for reading in found.graph_results} == spacings
    monkeypatch.setattr(search_number, "SIZES", (40,))
    for sensors, known in ((far, 2), (Sensors(range=30.0), 1), (Sensors(range=3.0), 2)):
        one = find_search_number(replace(game, sensors=Sensing(sensors)), space, told.append).graph_results[0]
        assert one.pursuers == known
    monkeypatch.setattr(search_number, "MOST_SEARCHERS", 1)
    assert find_search_number(game, space, told.append).graph_results == (), (
        "where no strategy is found nothing is said"
    )
