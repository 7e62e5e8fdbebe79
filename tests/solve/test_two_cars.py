"""The two-robot solver against the game of two cars: the same captures as in relative coordinates."""

from functools import cache

import pytest

from apollonius.game.types import Role
from tests.solve.two_cars import SPEEDS, Setting, captured, cells_apart, truth

pytestmark = pytest.mark.slow

SETTING = Setting(size=12.25, places=15, headings=12, holds=3)
TRUTH = cache(truth)


@pytest.fixture(scope="module", params=list(Role), ids=["lower", "upper"])
def found(request):
    """Where captures are certain by the lower value, and by the upper."""
    return captured(SETTING, request.param)


@pytest.mark.parametrize("speeds", SPEEDS.values(), ids=SPEEDS)
def test_the_solver_captures_two_cars_where_they_can_be_captured_within_a_cell(found, speeds):
    pursuer, evader = speeds
    too_large, too_small = cells_apart(SETTING, found[pursuer, ..., evader], TRUTH(SETTING, speeds))
    assert max(too_large, too_small) <= 1


@pytest.mark.parametrize(("played", "other"), [("both fast", "faster pursuer"), ("both fast", "faster evader")])
def test_other_games_are_more_than_a_cell_away(found, played, other):
    pursuer, evader = SPEEDS[played]
    assert max(cells_apart(SETTING, found[pursuer, ..., evader], TRUTH(SETTING, SPEEDS[other]))) > 1
