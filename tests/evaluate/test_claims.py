"""Verdicts follow from intervals, and intervals from the games and seeds they stand for."""

import numpy as np
import pytest

from apollonius.evaluate.claims import Claim
from apollonius.evaluate.statistics import predict
from apollonius.evaluate.suite_card import load_card
from tests.documents import REPOSITORY


@pytest.mark.parametrize(
    ("values", "is_full", "verdict"),
    [
        (((0.99,), (0.985,), (0.98,)), True, "holds"),
        (((0.97,), (0.96,), (0.95,)), True, "a draw among draws"),
        (((0.90,), (0.895,), (0.905,)), True, "does not hold"),
        (((0.99,), (0.985,), (0.98,)), False, "not enough"),
        (((0.99,), (0.985,)), True, "not enough"),
        (((0.9, 0.5, 0.99), (0.95, 0.4, 0.99), (0.92, 0.45, 0.99)), True, "a draw among draws"),
    ],
)
def test_the_whole_prediction_of_three_whole_trainings_must_agree(values, is_full, verdict):
    claim = Claim("rate", "here", 0.5, 0.96, values)
    assert claim.verdict(is_full) == claim.to_dict(is_full)["verdict"] == verdict


def test_a_claim_as_data_has_what_follows_from_its_values():
    claim = Claim("more", "here", 0.27, 0.1, ((0.3,), (0.1,), (0.2,)), least=-1.0)
    data, found = claim.to_dict(), predict(np.array(claim.values), -1.0, 1.0)
    assert data["mean"] == pytest.approx(0.2)
    assert (data["interval"], data["chance"]) == (found.interval, found.chance(0.1))


@pytest.mark.slow
def test_the_cards_of_the_leaderboard_follow_from_their_games():
    for path in (REPOSITORY / "benchmarks" / "leaderboard").glob("*.json"):
        assert path.stat().st_size < 100_000
        load_card(path)
