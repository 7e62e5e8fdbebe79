"""How many pursuers are enough in an arena: known ones, and graphs that do not agree."""

import pytest

from apollonius.arenas.free_space import largest_part
from apollonius.solve import enough
from tests.arenas.test_free_space import ANNULUS, BENT, ROOM

SMALL = ROOM.copy()
SMALL[50:62, 50:62] = False
"""An island that large cells do not see."""


def count(free, sizes):
    told = []
    found = enough.how_many(largest_part(free, 0.0, 0.0, 0.1), told.append, sizes=sizes)
    assert set(told) >= {reading.tiling.spacing for reading in found.readings}
    return found


@pytest.mark.parametrize(("free", "known"), [(ROOM, 1), (BENT, 1), (ANNULUS, 2)], ids=["room", "bent room", "annulus"])
def test_known_arenas(free, known):
    found = count(free, (60, 100, 150))
    assert found.agree
    assert found.pursuers == known
    assert found.verdict.startswith(("1 pursuer is enough", "2 pursuers are enough, 1 is not")[known - 1])


@pytest.mark.parametrize(
    ("free", "sizes", "pursuers", "islands", "said"),
    [
        (SMALL, (12, 200, 300), [1, 2, 2], [0, 1, 1], "do not agree"),
        (ANNULUS, (60, 100), [2, 2], [1, 1], "too few"),
        (SMALL, (12, 200, 300, 400), [1, 2, 2, 2], [0, 1, 1, 1], "2 pursuers are enough"),
        (ANNULUS, (60, 100, 150, 200), [2, 2, 2], [1, 1, 1], "2 pursuers are enough"),
    ],
    ids=["disagree", "two", "go on", "stop"],
)
def test_three_graphs_in_a_row_must_see_every_island_and_agree(free, sizes, pursuers, islands, said):
    found = count(free, sizes)
    assert [reading.pursuers for reading in found.readings] == pursuers
    assert [reading.tiling.holes for reading in found.readings] == islands
    assert said in found.verdict
    assert found.pursuers == (2 if "enough" in said else None)


def test_what_would_take_too_long_is_left_out(monkeypatch):
    monkeypatch.setattr(enough, "MOST_NODES", 20)
    found = count(ANNULUS, (60, 600))
    assert len(found.readings) == 1
    assert found.pursuers is None
