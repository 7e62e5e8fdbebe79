"""How many pursuers are enough in an arena: known ones, and graphs that do not agree."""

import numpy as np
import pytest

from apollonius.arenas.free_space import Tiling, largest_part
from apollonius.solve import enough
from tests.arenas.test_free_space import ANNULUS, BENT, ROOM

SMALL = ROOM.copy()
SMALL[50:62, 50:62] = False
"""An island that large cells do not see."""


def count(free, monkeypatch, sizes):
    monkeypatch.setattr(enough, "SIZES", sizes)
    told = []
    found = enough.how_many(largest_part(free, 0.0, 0.0, 0.1), lambda spacing, share: told.append((spacing, share)))
    assert {spacing for spacing, _ in told} >= {reading.tiling.spacing for reading in found.readings}
    return found


@pytest.mark.parametrize(("free", "known"), [(ROOM, 1), (BENT, 1), (ANNULUS, 2)], ids=["room", "bent room", "annulus"])
def test_known_arenas(free, known, monkeypatch):
    found = count(free, monkeypatch, (60, 100, 150))
    assert found.agree
    assert found.pursuers == known
    said = "1 pursuer is enough" if known == 1 else "2 pursuers are enough, 1 is not"
    assert found.verdict == f"{said}, for idealised robots on this graph"
    assert (found.evasion is None) == (known == 1)
    assert found.circled == found.space.islands
    assert len(found.starts) == known - 1


def test_the_evader_runs_through_free_space_round_the_island(monkeypatch):
    found = count(ANNULUS, monkeypatch, (60, 100, 150))
    column, row = np.floor(found.run / 0.1).astype(int).T
    assert ANNULUS[row, column].all()
    away = np.hypot(*(found.run - 6.0).T)
    assert away.min() > 2.5
    assert np.ptp(np.unwrap(np.arctan2(*(found.run - 6.0).T))) > 5


def test_graphs_that_do_not_agree_say_so(monkeypatch):
    found = count(SMALL, monkeypatch, (12, 200, 300))
    assert [reading.pursuers for reading in found.readings] == [1, 2, 2]
    assert [reading.islands for reading in found.readings] == [0, 1, 1]
    assert found.pursuers is None
    assert "do not agree" in found.verdict


def test_two_graphs_that_agree_settle_nothing(monkeypatch):
    found = count(ANNULUS, monkeypatch, (60, 100))
    assert [reading.pursuers for reading in found.readings] == [2, 2]
    assert found.pursuers is None
    assert "too few" in found.verdict


def test_it_goes_on_until_three_graphs_in_a_row_see_every_island(monkeypatch):
    found = count(SMALL, monkeypatch, (12, 200, 300, 400, 600))
    assert [reading.islands for reading in found.readings] == [0, 1, 1, 1]
    assert found.pursuers == 2


@pytest.mark.parametrize(("holes", "graphs"), [((1,) * 5, 3), ((0, 1, 1, 1, 1), 4), ((0,) * 5, 5)])
def test_graphs_that_miss_an_island_do_not_count_though_they_agree(holes, graphs, monkeypatch):
    links = (
        np.roll(np.eye(4, dtype=bool), 1, axis=0) & [[hole], [True], [True], [True]] for hole in np.array(holes, bool)
    )
    seen = (Tiling(np.zeros((4, 2)), link | link.T, 0.1, 0.0) for link in links)
    monkeypatch.setattr(enough, "tile", lambda *given: next(seen))
    monkeypatch.setattr(enough, "core", lambda adjacency: np.arange(1))
    monkeypatch.setattr(enough, "SIZES", (10, 20, 30, 40, 50))
    found = enough.how_many(largest_part(SMALL, 0.0, 0.0, 0.1), lambda spacing, share: None)
    assert [reading.islands for reading in found.readings] == list(holes[:graphs])
    assert found.unseen == 1 - holes[graphs - 1]
    assert found.pursuers == 1


def test_what_would_take_too_long_is_left_out(monkeypatch):
    monkeypatch.setattr(enough, "MOST_NODES", 20)
    found = count(ANNULUS, monkeypatch, (60, 600))
    assert len(found.readings) == 1
    assert found.pursuers is None
